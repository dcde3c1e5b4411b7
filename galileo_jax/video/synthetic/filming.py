"""How a clip is filmed: a camera, from metres to pixels, and what hand and sensor do to it."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import cv2
import numpy as np

FOCAL_WIDTHS = 1.2  # of a picture: a phone's lens, zoomed in a little
SWAY_S, SWAY_STEPS = 0.2, 10  # of a hand's sway; steps in such a time


@dataclass(frozen=True)
class Camera:
    """A camera that looks at the plane of motion from the side, perhaps not quite squarely.

    Pixels as in OpenCV: x right, y down, whole numbers at the middle of a pixel.
    """

    pixels_per_metre: float  # scale at the origin
    origin_px: tuple[float, float]  # where the foot of the ramp at table level is
    size_px: tuple[int, int] = (640, 360)  # (width, height)
    direction: Literal["right", "left"] = "right"  # which way x grows in the image
    # (along x, along y), 1/m: how much farther away, relative to its distance at the origin, the
    # plane is per metre; 0 is a camera held squarely
    keystone_per_m: tuple[float, float] = (0.0, 0.0)
    roll_rad: float = 0.0  # how far the picture is turned about the origin, counter-clockwise

    @property
    def world_to_image(self) -> np.ndarray:
        """The homography `[3, 3]` from (x, y, 1) in metres to pixels."""
        sign = 1.0 if self.direction == "right" else -1.0
        scale = self.pixels_per_metre
        about_origin = np.array(
            [[sign * scale, 0.0, 0.0], [0.0, -scale, 0.0], [*self.keystone_per_m, 1.0]]
        )
        return placed(self.origin_px, -self.roll_rad) @ about_origin

    def project(self, points_m: np.ndarray) -> np.ndarray:
        """Returns the pixels `[..., 2]` of the points `[..., 2]` in metres."""
        return project(self.world_to_image, points_m)


def placed(position: Sequence[float] | np.ndarray, angle_rad: float) -> np.ndarray:
    """The homography `[3, 3]` of a turn about (0, 0), from x to y, and a shift to `position`."""
    cos, sin = np.cos(angle_rad), np.sin(angle_rad)
    return np.array([[cos, -sin, position[0]], [sin, cos, position[1]], [0, 0, 1]])


def project(homography: np.ndarray, points: np.ndarray) -> np.ndarray:
    """Applies a homography `[3, 3]` to points `[..., 2]`."""
    mapped = np.asarray(points) @ homography[:, :2].T + homography[:, 2]
    return mapped[..., :2] / mapped[..., 2:]


@dataclass(frozen=True)
class Hand:
    """A hand with an arm that holds object 1 at the start, lets go and leaves the picture."""

    leave_s: float  # when it begins to draw back, s
    speed_m_s: float = 1.4  # how fast it then goes, m/s
    # (x, y) of its finger tips from object 1's centre at the start, m
    offset_m: tuple[float, float] = (-0.012, 0.015)
    # direction of the arm, from the finger tips, counter-clockwise from the travel; 2.4 is
    # backwards and up
    angle_rad: float = 2.4


@dataclass(frozen=True)
class Filming:
    """Frame rate, exposure and faults."""

    fps: float = 30.0  # frames per second; frame i is taken at time i / fps
    written_fps: float | None = None  # what the file says; None = the truth
    exposure_s: float = 0.008  # how long the shutter is open, evenly about the frame's time, s
    # standard deviation of the sensor noise, independent in every pixel and colour; of 255
    noise_grey_levels: float = 4.0
    flicker: float = 0.007  # relative standard deviation of the brightness from frame to frame
    defocus_px: float = 0.0  # standard deviation of the blur of the whole picture, px
    # frames that the camera missed; the picture before stands there again
    repeated_frames: tuple[int, ...] = ()
    hand: Hand | None = None  # the hand that lets object 1 go; None = nobody is in the picture
    # sd of how far the camera turns about each axis, rad; 0: it stands on something
    sway_rad: float = 0.0


def turned_camera(turns_rad: np.ndarray, size_px: tuple[int, int]) -> np.ndarray:
    """The homography from places in a camera's picture to those after it has turned, `[3, 3]`.

    `turns_rad`: to the side, up, and about the line of sight. Source: R. Hartley, A. Zisserman,
    Multiple View Geometry (2004), 8.4.
    """
    width, height = size_px
    focal_px = FOCAL_WIDTHS * width
    lens = np.array([[focal_px, 0, width / 2], [0, focal_px, height / 2], [0, 0, 1]])
    across, up, round_sight = turns_rad
    turn, _ = cv2.Rodrigues(np.array([up, across, round_sight]))
    return lens @ turn @ np.linalg.inv(lens)


def sway(filming: Filming, num_frames: int, rng: np.random.Generator) -> np.ndarray:
    """How far a camera in a hand has turned in each frame, `[frame, 3]`, rad; first not at all.

    A critically damped oscillator driven by white noise, which forgets in some `SWAY_S`.
    """
    steps = int(np.ceil(SWAY_STEPS / (filming.fps * SWAY_S)))
    dt = 1 / (filming.fps * steps)
    rate, place, speed, found = 1 / SWAY_S, np.zeros(3), np.zeros(3), []
    push = 2 * filming.sway_rad * rate**1.5 * np.sqrt(dt)
    for _ in range(num_frames):
        found.append(place)
        for _ in range(steps):
            speed = speed + dt * rate * (-rate * place - 2 * speed) + push * rng.normal(size=3)
            place = place + dt * speed
    return np.array(found)
