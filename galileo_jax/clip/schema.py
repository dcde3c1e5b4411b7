"""The clip: a video or a track, and the scene that its yaml file describes.

`ClipFile` has the keys of the yaml (docs/reference/clip_yaml.md); `Clip` adds what loading found
out. What a value may be is in `fields`; checks that need several values, or the video, are in
`checks` and `placement`.
"""

from pathlib import Path
from typing import Annotated, Any

from pydantic import BaseModel, BeforeValidator, ConfigDict, Field

from galileo_jax.clip import fields
from galileo_jax.clip.camera_geometry import Lens, Rectangle
from galileo_jax.clip.scenarios import SCENARIOS
from galileo_jax.clip.walls import Walls


class ClipObject(BaseModel):
    """One object in the clip."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    name: fields.ObjectName  # unique in the clip; also the prefix of its columns in a csv track
    shape: fields.Shape
    # box (length along travel, depth, height), cylinder (radius, length), torus (ring radius, tube
    # radius), sphere (radius), m; None = not known
    size_m: tuple[fields.Metres, ...] | None = None
    # weighed; None = not known. A motion along a slope does not tell it, and with it forces that do
    # not grow with the mass (drag) get their unit.
    mass_kg: fields.Kilograms | None = None
    # its centre as marked by eye, pixels (x right, y down), in `first_frame`; None = to be found
    point_px: fields.MarkedPoint | None = None
    # the first frame in which the object moves by itself; frames before are not used for it. None =
    # not known: the release is found from the motion.
    first_frame: fields.Frame | None = 0
    # the last frame that is used for it; None = that of the clip
    last_frame: fields.Frame | None = None
    # (frame, x, y), px: where somebody has seen it in frames in which the program had lost it; it
    # is followed on from there
    corrections: fields.Corrections = ()
    # whether it may roll: a cylinder on its side, a torus on edge; a sphere always may. A number is
    # its moment of inertia over m r^2, where it is not that of a solid.
    rolls: fields.Rolls = None
    # how far its centre is from the plane in which object 1 moves, m, positive towards the camera;
    # of use to `--motion free` only
    z_m: fields.Across = 0.0
    spin_rad_s: fields.Spin = None  # flight: its spin where it was measured, along the track's axes
    # what another tool's track file calls it; None = the same, or the only one
    track_name: fields.OneLine | None = None
    # a table of its own, on the same clock as `track`; None = it is in `track`
    track_file: fields.File = None

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


UNCERTAINTY_OF = {
    "ramp_angle_deg": "ramp_angle_sd_deg",
    "pixels_per_metre": "pixels_per_metre_sd",
    "origin_px": "origin_sd_px",
}
"""By key the one that says how well it is known."""


def _scenario(value: Any) -> Any:
    if not isinstance(value, str) or value not in SCENARIOS:
        known = ", ".join(SCENARIOS)
        raise fields.wrong(f"unknown value {fields.short(value)}; known: {known}")
    return value


class ClipFile(BaseModel):
    """The keys of a clip yaml; see `Clip` for their meaning."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    video: fields.File = None
    track: fields.File = None
    trial: fields.Trial = None
    track_units: fields.LengthUnit | None = None
    track_y: fields.YAxis | None = None
    track_origin: fields.Point | None = None
    track_up: fields.UpAxis = "y"
    scenario: Annotated[str, BeforeValidator(_scenario)]
    fps: fields.FrameRate
    ramp_angle_deg: fields.RampAngle | None = None
    ramp_angle_sd_deg: fields.AngleSd = 0.0
    direction: fields.Direction = "right"
    pixels_per_metre: fields.Scale | None = None
    pixels_per_metre_sd: fields.ScaleSd | None = None
    rectangle: Rectangle | None = None
    lens: Lens | None = None
    origin_px: fields.Point | None = None
    origin_sd_px: fields.OriginSd = 0.0
    gravity: fields.Gravity = 9.81
    vertical_sd_deg: fields.AngleSd = 0.0
    launch_angle_deg: Annotated[fields.Number, Field(gt=-90, lt=90)] | None = None
    starts_moving: fields.Yes | None = None
    floor: fields.Floor = None
    liquid_density: fields.LiquidDensity | None = None
    thread_m: fields.Thread | None = None
    pivot_m: fields.Point | None = None
    walls: Walls = ()
    turning: fields.Yes = False
    objects: tuple[ClipObject, ...]

    @property
    def has_floor(self) -> bool:
        """Whether the object may reach a floor."""
        return self.floor is not None and self.floor is not False

    @property
    def sign(self) -> float:
        """1 where x, along the travel, is to the right in the picture, else -1."""
        return 1.0 if self.direction == "right" else -1.0


class Clip(ClipFile):
    """A loaded and checked clip.

    Attributes:
      path: the yaml.
      source: what was asked for, as it was written in the call: a video, a track or the yaml.
      video: the video file; None for a csv track.
      track: the track file, ours or another tool's; None for a video.
      trial: which of the motions that follow each other in the track, counted from 1; None = the
        only one.
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
      pixels_per_metre_sd: how well it is known (one standard deviation); 0 = exactly, None = not
        said: a thousandth of it is allowed for.
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
      starts_moving: incline, fall: the object moves already in the first frame that is used; None
        = found from its path.
      floor: fall, flight: its height over the origin, m; true = there is one, at a height to be
        inferred; None or false = none is reached.
      liquid_density: liquid: kg/m^3; None = not known.
      thread_m: pendulum: from the pivot to the bob's centre, m; None = not known.
      pivot_m: pendulum: (x, y) of the pivot from the origin, m; None = not known.
      walls: from_above: straight walls off which pucks bounce.
      turning: from_above: the turning that a video shows is part of the data.
      objects: at least one, names unique.
      is_scale_assumed: lengths are in units of something in the picture, which a
        `pixels_per_metre` that means nothing else gives a size.
      is_own_track: the track is our own csv, in metres along our axes.
      frame_count: frames that decode, or rows of the csv track.
      frame_size_px: (width, height); None for a csv track.
      frame_times_s: when each frame of a video was taken, the first at 0; empty for a csv track.
      container_fps: what the video's container says, right or wrong; None where it says nothing.
      warnings: doubts found while loading, one line each; commands print them.
    """

    path: Path
    source: str = ""
    is_scale_assumed: bool = False
    is_own_track: bool = False
    frame_count: int
    frame_size_px: tuple[int, int] | None = None
    frame_times_s: tuple[float, ...] = ()
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
