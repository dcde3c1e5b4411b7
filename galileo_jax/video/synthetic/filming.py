"""How a clip is filmed: what a real camera and a real hand do to it."""

from dataclasses import dataclass


@dataclass(frozen=True)
class Hand:
    """A hand with an arm that holds object 1 at the start, lets go and leaves the picture.

    Attributes:
      leave_s: when it begins to draw back, s.
      speed_m_s: how fast it then goes, m/s.
      offset_m: (x, y) of its finger tips from object 1's centre at the start, m.
      angle_rad: direction of the arm, from the finger tips, counter-clockwise from the
        travel; 2.4 is backwards and up.
    """

    leave_s: float
    speed_m_s: float = 1.4
    offset_m: tuple[float, float] = (-0.012, 0.015)
    angle_rad: float = 2.4


@dataclass(frozen=True)
class Filming:
    """Frame rate, exposure and faults.

    Attributes:
      fps: frames per second; frame i is taken at time i / fps.
      written_fps: what the file says; None = the truth.
      exposure_s: how long the shutter is open, evenly about the frame's time, s.
      noise_grey_levels: standard deviation of the sensor noise, independent in every pixel
        and colour; of 255.
      flicker: relative standard deviation of the brightness from frame to frame.
      defocus_px: standard deviation of the blur of the whole picture, px.
      repeated_frames: frames that the camera missed; the picture before stands there again.
      hand: the hand that lets object 1 go; None = nobody is in the picture.
    """

    fps: float = 30.0
    written_fps: float | None = None
    exposure_s: float = 0.008
    noise_grey_levels: float = 4.0
    flicker: float = 0.007
    defocus_px: float = 0.0
    repeated_frames: tuple[int, ...] = ()
    hand: Hand | None = None
