"""`label`: what is known about a clip, into the yaml beside it."""

from collections.abc import Mapping, Sequence
from pathlib import Path

from galileo_jax.api.options import options_of
from galileo_jax.clip.declaration import Declaration
from galileo_jax.clip.label import LabelledClip, label_clip


def label(
    clip: str | Path,
    *,
    scenario: str | None = None,
    fps: float | None = None,
    point: Mapping[str, Sequence[float]] | None = None,
    size: Mapping[str, Sequence[float]] | None = None,
    shape: Mapping[str, str] | None = None,
    first_frame: Mapping[str, int | None] | None = None,
    last_frame: Mapping[str, int | None] | None = None,
    correct: Mapping[str, Sequence[Sequence[float]]] | None = None,
    pixels_per_metre: float | None = None,
    pixels_per_metre_sd: float | None = None,
    scale: Sequence[float] | None = None,
    rectangle: Sequence[float] | None = None,
    lens: Sequence[float] | None = None,
    ramp_angle: float | None = None,
    ramp_angle_sd: float | None = None,
    ramp: Sequence[float] | None = None,
    track_units: str | None = None,
    track_y: str | None = None,
    track_origin: Sequence[float] | None = None,
    direction: str | None = None,
    origin: Sequence[float] | None = None,
    origin_sd: float | None = None,
    gravity: float | None = None,
    level: str = "trial",
) -> LabelledClip:
    """Writes what is known about a clip into the yaml beside it, or creates that.

    Comments and order of a yaml that is there stay. Nothing is written unless the result is
    valid. Pixels: x right, y down, as any image viewer shows them.

    Args:
      clip: the video, the track file or the yaml.
      scenario: what the clip shows, such as ramp, incline or fall.
      fps: true frames per second; None: unchanged, in a new yaml the video's.
      point: object name to its centre in its first frame, (x, y), px; a new name adds an
        object, as do the next three.
      size: object name to its size, m. box: length, depth, height; cylinder: radius, length;
        torus: radii; sphere: radius.
      shape: object name to box (what a new object is otherwise), cylinder, torus or sphere.
      first_frame: object name to the first frame in which it moves by itself, from 0; None: to
        be found.
      last_frame: object name to the last frame that is used; None: that of the clip.
      correct: object name to (frame, x, y): where it is, px, in frames in which it was lost; it is
        followed on from there; (frame,) takes that back.
      pixels_per_metre: of the picture.
      pixels_per_metre_sd: how well that is known (one standard deviation); None: of a `scale`,
        what half a pixel at either end makes of it.
      scale: (x1, y1, x2, y2, metres): two pixels and the distance between them, in place of
        pixels_per_metre.
      rectangle: (x, y) of the four corners, px, of a rectangle in the plane of the motion, from the
        bottom left one counter-clockwise, then its width and height, m: in place of a scale where
        the camera is not square to the plane. Its bottom side is level.
      lens: k1, or (k1, standard deviation): a point r half diagonals from the picture's middle is
        drawn at r (1 + k1 r^2).
      ramp_angle: of the ramp, degrees.
      ramp_angle_sd: how well that is known, degrees; None: of a `ramp`, by half a pixel.
      ramp: (x1, y1, x2, y2): two pixels on the ramp: its angle and direction, in place of
        ramp_angle.
      track_units: of a track file: m, cm, mm, in, ft or px.
      track_y: of a track file: whether y points up or down.
      track_origin: of a track file: the foot of the ramp, (x, y), in its unit and along its
        axes.
      direction: of the travel: right or left.
      origin: the foot of the ramp, (x, y), px.
      origin_sd: how well either coordinate is known, px; None: of an `origin`, half a pixel.
      gravity: m/s^2; None: unchanged, in a new yaml 9.81.
      level: of a clip in folders of Physics 101: about which of them this is declared:
        scenario, setup, object or trial (points are always of the trial, sizes of the object).

    Returns:
      The yaml's path, the clip as it is declared now (`clip.warnings` has doubts), and notes.

    Raises:
      InputError: nothing is declared, or the clip would be wrong; nothing is written then.

    Examples:
      >>> import galileo_jax as gx
      >>> made = gx.simulate("slide.csv", scenario="incline", seed=1, track_only=True)
      >>> gx.label("slide.csv", gravity=9.8).clip.gravity
      9.8
    """
    return label_clip(Path(clip), options_of(Declaration, locals()))
