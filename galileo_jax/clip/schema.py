"""The clip: a video or a track, and the scene that its yaml file describes.

`ClipFile` has the keys of the yaml (docs/reference/clip_yaml.md); `Clip` adds what loading found
out. Each value is checked for type, range and common unit mistakes. Checks that need several
values, or the video, are in `load` and `placement`.
"""

import math
import reprlib
from pathlib import Path
from typing import Annotated, Any, Literal, get_args

from pydantic import AfterValidator, BaseModel, BeforeValidator, ConfigDict, Field
from pydantic_core import PydanticCustomError

from galileo_jax.clip.camera_geometry import Lens, Rectangle
from galileo_jax.clip.scenarios import SCENARIOS

LengthUnit = Literal["m", "cm", "mm", "km", "in", "ft", "px"]
YAxis = Literal["up", "down"]
UpAxis = Literal["y", "z"]
Shape = Literal["box", "cylinder", "torus", "sphere"]
Direction = Literal["right", "left"]

SIZE_MEANING: dict[str, str] = {
    "box": "[length along travel, depth, height]",
    "cylinder": "[radius, length]",
    "torus": "[ring radius, tube radius]",
    "sphere": "[radius]",
}

MIN_SIZE_M, MAX_SIZE_M = 0.001, 2.0
MAX_ACROSS_M = 0.5
MIN_THREAD_M, MAX_THREAD_M = 0.01, 30.0
MIN_SCALE_PX_PER_M, MAX_SCALE_PX_PER_M = 5.0, 100_000.0
MIN_MASS_KG, MAX_MASS_KG = 1e-5, 100.0
MIN_GRAVITY, MAX_GRAVITY = 0.1, 30.0
MIN_DENSITY, MAX_DENSITY = 100.0, 20_000.0  # kg/m^3, of a liquid
MIN_FPS, MAX_FPS = 1.0, 1_000_000.0
MAX_FLOOR_M = 1e6
MAX_ANGLE_SD_DEG = 10.0
MAX_SCALE_SD_SHARE = 0.2  # a scale known worse than this is a guess: leave it null
MAX_ORIGIN_SD_PX = 50.0  # a foot known worse than this is null: found from the path
MIN_RAMP_ANGLE_DEG = 1.0  # below it nothing slides; it is an angle in radians


def wrong(message: str) -> PydanticCustomError:
    """A validation error whose text reaches the user as it stands."""
    return PydanticCustomError("clip", "{text}", {"text": message})


def _suggestion(value: float, *factors_and_units: tuple[float, str]) -> str:
    """' did you mean 0.06 (60 mm)?' for the first (factor, unit) that is given."""
    factor, unit = factors_and_units[0]
    return f"did you mean {value * factor:g} ({value:g} {unit})?"


def _metres(value: float) -> float:
    if value <= 0:
        raise wrong(f"{value:g} is not a length; metres above 0 expected")
    if value > MAX_SIZE_M:
        hint = _suggestion(value, (0.01, "cm") if value < 20 else (0.001, "mm"))
        raise wrong(f"{value:g} m is too large for an object; metres expected; {hint}")
    if value < MIN_SIZE_M:
        raise wrong(f"{value:g} m is smaller than a millimetre; metres expected")
    return value


def _across(value: float) -> float:
    if abs(value) > MAX_ACROSS_M:
        hint = _suggestion(value, (0.01, "cm") if abs(value) < 20 else (0.001, "mm"))
        raise wrong(f"{value:g} m is too far from the plane of the motion; metres expected; {hint}")
    return value


def _thread(value: float) -> float:
    if not MIN_THREAD_M <= value <= MAX_THREAD_M:
        hint = "; " + _suggestion(value, (0.01, "cm")) if value > MAX_THREAD_M else ""
        raise wrong(
            f"{value:g} m is no length of a thread; {MIN_THREAD_M:g} to {MAX_THREAD_M:g} m "
            f"expected{hint}"
        )
    return value


def _kilograms(value: float) -> float:
    if value <= 0:
        raise wrong(f"{value:g} is not a mass; kilograms above 0 expected")
    if value > MAX_MASS_KG:
        hint = _suggestion(value, (0.001, "g"))
        raise wrong(f"{value:g} kg is too heavy for an object; kilograms expected; {hint}")
    if value < MIN_MASS_KG:
        raise wrong(f"{value:g} kg is less than ten milligrams; kilograms expected")
    return value


def _pixels_per_metre(value: float) -> float:
    if value <= 0:
        raise wrong(f"{value:g} is not a scale; pixels per metre above 0, or null, expected")
    if value < MIN_SCALE_PX_PER_M:
        hint = (
            f"did you mean {1 / value:.4g} ({value:g} metres per pixel)?"
            if value < 0.05
            else _suggestion(value, (1000, "pixels per millimetre"))
        )
        raise wrong(f"{value:g} is too small; pixels per metre expected; {hint}")
    if value > MAX_SCALE_PX_PER_M:
        raise wrong(
            f"{value:g} is too large; pixels per metre expected; did you mean {value / 1000:g}?"
        )
    return value


def _gravity(value: float) -> float:
    if value <= 0:
        hint = f"; did you mean {-value:g}?" if MIN_GRAVITY <= -value <= MAX_GRAVITY else ""
        raise wrong(f"{value:g} is not above 0; the size of gravity in m/s^2 expected{hint}")
    if value > MAX_GRAVITY:
        raise wrong(
            f"{value:g} is too large; m/s^2 expected; " + _suggestion(value, (0.01, "cm/s^2"))
        )
    if value < MIN_GRAVITY:
        raise wrong(f"{value:g} is too small; m/s^2 expected (9.81 on earth)")
    return value


def _fps(value: float) -> float:
    if value <= 0:
        raise wrong(f"{value:g} is not above 0; frames per second expected")
    if value < MIN_FPS:
        hint = f"did you mean {1 / value:.4g} ({value:g} seconds per frame)?"
        raise wrong(f"{value:g} is too small; frames per second expected; {hint}")
    if value > MAX_FPS:
        raise wrong(f"{value:g} is too large; frames per second expected")
    return value


def _ramp_angle_deg(value: float) -> float:
    if not 0 < value < 90:
        raise wrong(f"{value:g} is outside (0, 90) degrees")
    if value < MIN_RAMP_ANGLE_DEG:
        degrees = math.degrees(value)
        raise wrong(
            f"{value:g} is too flat to slide; degrees expected; "
            f"did you mean {degrees:.4g} ({value:g} radians)?"
        )
    return value


def _angle_sd_deg(value: float) -> float:
    if not 0 <= value <= MAX_ANGLE_SD_DEG:
        raise wrong(f"{value:g} is outside [0, {MAX_ANGLE_SD_DEG:g}] degrees")
    return value


def _scale_sd(value: float) -> float:
    if value < 0:
        raise wrong(f"{value:g} is negative; pixels per metre, 0 or more, expected")
    return value


def _origin_sd_px(value: float) -> float:
    if not 0 <= value <= MAX_ORIGIN_SD_PX:
        raise wrong(f"{value:g} is outside [0, {MAX_ORIGIN_SD_PX:g}] pixels")
    return value


def _floor(value: Any) -> Any:
    if isinstance(value, bool) or value is None:
        return value
    # Integers of YAML may be larger than any float.
    if isinstance(value, int | float) and abs(value) < MAX_FLOOR_M:
        return float(value)
    raise wrong(f"{short(value)} is no height; metres above the origin, or true, expected")


def _rolls(value: Any) -> Any:
    if isinstance(value, bool) or value is None:
        return value
    if isinstance(value, int | float) and 0 < value <= 1:
        return float(value)
    raise wrong(
        f"{short(value)} is no share J / (m r^2) in (0, 1]; a share such as 0.667 (hollow ball), "
        "or true (solid), expected"
    )


def _liquid_density(value: float) -> float:
    if value <= 0:
        raise wrong(f"{value:g} is not a density; kg/m^3 above 0 expected")
    if value < MIN_DENSITY:
        raise wrong(
            f"{value:g} is too small for a liquid; kg/m^3 expected; "
            + _suggestion(value, (1000, "g/cm^3"))
        )
    if value > MAX_DENSITY:
        raise wrong(f"{value:g} is too large; kg/m^3 expected (water: 998)")
    return value


def _point_px(value: tuple[float, float]) -> tuple[float, float]:
    if all(0 < coordinate < 1 for coordinate in value):
        raise wrong(f"{list(value)} are fractions of the frame; pixels expected")
    return value


def _name(value: str) -> str:
    if not value.isidentifier():
        raise wrong(f"{short(value)} is no name; letters, digits and _ expected, such as object1")
    return value


def _corrections(value: Any) -> Any:
    """A list of [frame, x, y]; pydantic sees to the numbers."""
    is_list = isinstance(value, list | tuple)
    if not is_list or not all(isinstance(one, list | tuple) and len(one) == 3 for one in value):
        raise wrong(f"{short(value)} is no list of [frame, x, y], such as [[24, 312.0, 221.5]]")
    frames = [one[0] for one in value]
    if len({*map(str, frames)}) < len(frames):
        raise wrong(f"{short(value)} has a frame twice; one place for each frame expected")
    return tuple(map(tuple, value))


def _path(value: Any) -> Any:
    if isinstance(value, str) and 0 < len(value) < 256 and value.isprintable():
        return Path(value)
    if isinstance(value, Path) or value is None:
        return value
    raise wrong(f"{short(value)} is not a file name")


def _one_of(known: tuple[str, ...]) -> BeforeValidator:
    """Refuses anything but the `known` words and lists them."""

    def check(value: Any) -> Any:
        if not isinstance(value, str) or value not in known:
            raise wrong(f"unknown value {short(value)}; known: {', '.join(known)}")
        return value

    return BeforeValidator(check)


_REPR = reprlib.Repr()  # aliases in a yaml can make a value that is endless when written out
_REPR.maxlevel, _REPR.maxstring, _REPR.maxother = 3, 60, 60


def short(value: Any) -> str:
    """A value as it looks in yaml, cut to 60 characters, on one line."""
    if value is None or isinstance(value, bool):
        return {None: "null", True: "true", False: "false"}[value]
    try:
        text = " ".join(_REPR.repr(value).split())
    except ValueError:  # an integer with more digits than Python prints
        text = "a number of thousands of digits"
    return text if len(text) <= 60 else text[:57] + "..."


Number = Annotated[float, Field(strict=True, allow_inf_nan=False)]
Metres = Annotated[Number, AfterValidator(_metres)]
Kilograms = Annotated[Number, AfterValidator(_kilograms)]
Point = tuple[Number, Number]
Correction = tuple[Annotated[int, Field(strict=True, ge=0)], Number, Number]
File = Annotated[Path | None, BeforeValidator(_path)]
OneLine = Annotated[str, Field(strict=True, min_length=1, max_length=80)]


class ClipObject(BaseModel):
    """One object in the clip.

    Attributes:
      name: unique in the clip; also the prefix of its columns in a csv track.
      shape: box, cylinder, torus or sphere.
      size_m: box (length along travel, depth, height), cylinder (radius, length), torus
        (ring radius, tube radius), sphere (radius), m; None = not known.
      mass_kg: weighed; None = not known. A motion along a slope does not tell it, and with it
        forces that do not grow with the mass (drag) get their unit.
      point_px: its centre as marked by eye, pixels (x right, y down), in `first_frame`;
        None = to be found.
      first_frame: the first frame in which the object moves by itself; frames before are
        not used for it. None = not known: the release is found from the motion.
      last_frame: the last frame that is used for it; None = that of the clip.
      corrections: (frame, x, y), px: where somebody has seen it in frames in which the program
        had lost it; it is followed on from there.
      rolls: whether it may roll: a cylinder on its side, a torus on edge; a sphere always may.
        A number is its moment of inertia over m r^2, where it is not that of a solid.
      z_m: how far its centre is from the plane in which object 1 moves, m, positive towards the
        camera; of use to `--motion free` only.
      spin_rad_s: flight: its spin where it was measured, along the track's axes.
      track_name: what another tool's track file calls it; None = the same, or the only one.
    """

    model_config = ConfigDict(frozen=True, extra="forbid")

    name: Annotated[str, Field(strict=True), AfterValidator(_name)]
    shape: Annotated[Shape, _one_of(get_args(Shape))]
    size_m: tuple[Metres, ...] | None = None
    mass_kg: Kilograms | None = None
    point_px: Annotated[Point, AfterValidator(_point_px)] | None = None
    first_frame: Annotated[int, Field(strict=True, ge=0)] | None = 0
    last_frame: Annotated[int, Field(strict=True, ge=0)] | None = None
    corrections: Annotated[tuple[Correction, ...], BeforeValidator(_corrections)] = ()
    rolls: Annotated[bool | float | None, BeforeValidator(_rolls)] = None
    z_m: Annotated[Number, AfterValidator(_across)] = 0.0
    spin_rad_s: tuple[Number, Number, Number] | None = None
    track_name: OneLine | None = None

    @property
    def roll_inertia(self) -> float | None:
        """J / (m r^2) about the axis it rolls about; None: it slides whatever the friction."""
        if self.shape == "box" or self.rolls is False or (self.rolls is None and not self.is_ball):
            return None
        if isinstance(self.rolls, float):
            return self.rolls
        if self.shape == "torus":
            ring, tube = self.size_m or (1.0, 0.5)
            return (ring**2 + 0.75 * tube**2) / (ring + tube) ** 2
        return 0.4 if self.is_ball else 0.5

    @property
    def is_ball(self) -> bool:
        """Whether it is a sphere."""
        return self.shape == "sphere"


class ClipFile(BaseModel):
    """The keys of a clip yaml; see `Clip` for their meaning."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    video: File = None
    track: File = None
    track_units: Annotated[LengthUnit, _one_of(get_args(LengthUnit))] | None = None
    track_y: Annotated[YAxis, _one_of(get_args(YAxis))] | None = None
    track_origin: Point | None = None
    track_up: Annotated[UpAxis, _one_of(get_args(UpAxis))] = "y"
    scenario: Annotated[str, _one_of(tuple(SCENARIOS))]
    fps: Annotated[Number, AfterValidator(_fps)]
    ramp_angle_deg: Annotated[Number, AfterValidator(_ramp_angle_deg)] | None = None
    ramp_angle_sd_deg: Annotated[Number, AfterValidator(_angle_sd_deg)] = 0.0
    direction: Annotated[Direction, _one_of(get_args(Direction))] = "right"
    pixels_per_metre: Annotated[Number, AfterValidator(_pixels_per_metre)] | None = None
    pixels_per_metre_sd: Annotated[Number, AfterValidator(_scale_sd)] = 0.0
    rectangle: Rectangle | None = None
    lens: Lens | None = None
    origin_px: Point | None = None
    origin_sd_px: Annotated[Number, AfterValidator(_origin_sd_px)] = 0.0
    gravity: Annotated[Number, AfterValidator(_gravity)] = 9.81
    vertical_sd_deg: Annotated[Number, AfterValidator(_angle_sd_deg)] = 0.0
    launch_angle_deg: Annotated[Number, Field(gt=-90, lt=90)] | None = None
    starts_moving: Annotated[bool, Field(strict=True)] = False
    floor: Annotated[bool | float | None, BeforeValidator(_floor)] = None
    liquid_density: Annotated[Number, AfterValidator(_liquid_density)] | None = None
    thread_m: Annotated[Number, AfterValidator(_thread)] | None = None
    pivot_m: Point | None = None
    objects: tuple[ClipObject, ...]


class Clip(ClipFile):
    """A loaded and checked clip.

    Attributes:
      path: the yaml.
      source: what was asked for, as it was written in the call: a video, a track or the yaml.
      video: the video file; None for a csv track.
      track: the track file, ours or another tool's; None for a video.
      track_units: of a track file of another tool, or of its calibration; "px" = pixels.
      track_y: which way its y axis points.
      track_up: which axis of our own csv of a flight in space points up.
      track_origin: where the foot of the ramp is in a track file in units of length, in these
        units and along its axes.
      scenario: a name in `SCENARIOS`.
      fps: true frames per second; declared, or for a csv track without it 1 / median step.
      ramp_angle_deg: in [1, 90) degrees; None where the scenario has no ramp.
      ramp_angle_sd_deg: how well it is known (one standard deviation); 0 = taken at its word.
      direction: which way object 1 travels in the image.
      pixels_per_metre: None = unknown.
      pixels_per_metre_sd: how well it is known (one standard deviation); 0 = taken at its word.
      rectangle: four corners in the plane of the motion, which tell the scale and how the camera
        stands; `pixels_per_metre` is then that of its middle.
      lens: how the lens bends straight lines; None = it does not.
      origin_px: foot of the ramp at table level, pixels, x right, y down; None = unknown.
      origin_sd_px: how well each of its coordinates is known (one standard deviation); 0 = as
        well as any start, some millimetres.
      gravity: m/s^2.
      vertical_sd_deg: flight: how well the picture's vertical is gravity's direction (one
        standard deviation); 0 = taken at its word.
      launch_angle_deg: flight: at which a launcher is set, over the horizontal; None = not known,
        or thrown by hand.
      starts_moving: incline: the object moves already in the first frame that is used.
      floor: fall, flight: its height over the origin, m; true = there is one, at a height to be
        inferred; None or false = none is reached.
      liquid_density: liquid: kg/m^3; None = not known.
      thread_m: pendulum: from the pivot to the bob's centre, m; None = not known.
      pivot_m: pendulum: (x, y) of the pivot from the origin, m; None = not known.
      objects: at least one, names unique.
      is_scale_assumed: lengths are in units of something in the picture, which a
        `pixels_per_metre` that means nothing else gives a size.
      is_own_track: the track is our own csv, in metres along our axes.
      frame_count: frames that decode, or rows of the csv track.
      frame_size_px: (width, height); None for a csv track.
      container_fps: what the video's container says, right or wrong; None where it says nothing.
      warnings: doubts found while loading, one line each; commands print them.
    """

    path: Path
    source: str = ""
    is_scale_assumed: bool = False
    is_own_track: bool = False
    frame_count: int
    frame_size_px: tuple[int, int] | None = None
    container_fps: float | None = None
    warnings: tuple[str, ...] = ()

    @property
    def is_scale_known(self) -> bool:
        """Whether lengths are in metres, not in pixels of unknown size."""
        if self.is_scale_assumed:
            return False
        is_in_metres = self.track is not None and self.track_units != "px"
        return self.pixels_per_metre is not None or is_in_metres

    @property
    def is_camera_plain(self) -> bool:
        """Whether pixels become metres by a scale alone."""
        return self.rectangle is None and self.lens is None

    @property
    def has_floor(self) -> bool:
        """Whether the object may reach a floor."""
        return self.floor is not None and self.floor is not False
