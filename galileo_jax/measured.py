"""From the clips of a call to what was measured: what every command that fits begins with."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from galileo_jax import command
from galileo_jax.arrest import until_arrest
from galileo_jax.clip.load import load_clip
from galileo_jax.clip.scenarios import SCENARIOS
from galileo_jax.clip.schema import Clip
from galileo_jax.clip.track_files.read import read_track
from galileo_jax.clock import clock_doubt
from galileo_jax.errors import InputError
from galileo_jax.foot import foot_of_path, needs_foot
from galileo_jax.observation import Observation, observe
from galileo_jax.rollout.engine_names import ENGINES
from galileo_jax.sizes import SIZE_SD_M, needs_sizes, sizes_of_track
from galileo_jax.slope import Slope, needs_slope, slope_of_path


@dataclass(frozen=True)
class Measured:
    """A clip and where its objects were seen.

    Attributes:
      clip: with what was inferred filled in.
      observation: in metres.
      inferred: key of the clip that was left null to value and sd.
      doubts: of what is declared, one line each.
    """

    clip: Clip
    observation: Observation
    inferred: Mapping[str, Mapping[str, Any]] = field(default_factory=dict)
    doubts: tuple[str, ...] = ()

    @property
    def name(self) -> str:
        """The clip's, without folder and suffix."""
        return self.clip.path.stem


def add_clip_options(parser: command.Parser, out: str) -> None:
    """Adds what `fit`, `compare` and `diagnose` have in common; `out` is the help of --out."""
    parser.add_argument(
        "--effects-from", action="append", default=[], metavar="FILE", help="more effects (Python)"
    )
    parser.add_argument("--out", help=out)
    parser.add_argument("--seed", type=command.whole_number(0), default=0)
    parser.add_argument("--engine", choices=ENGINES, default="auto")
    parser.add_argument("--pixels-per-metre", type=float, help="overrides the clip's scale")


def load_clips(paths: Sequence[str], pixels_per_metre: float | None = None) -> list[Clip]:
    """Loads and checks the clips of a call, trials of the same objects.

    Raises:
      InputError: a clip is wrong, two have the same name, or they are not trials of the same
        objects.
    """
    clips = [load_clip(Path(path), pixels_per_metre=pixels_per_metre) for path in paths]
    for clip in clips:
        for warning in clip.warnings:
            command.console().print(f"warning: {warning}")
        if SCENARIOS[clip.scenario].has_table and not clip.is_scale_known:
            raise InputError(
                f"{clip.path}: pixels_per_metre: null; the scale of a ramp clip cannot be told "
                "from its motion; set it with `galileo label --scale X1 Y1 X2 Y2 METRES` or "
                "--pixels-per-metre"
            )
    first = clips[0]
    for i, clip in enumerate(clips[1:], 1):
        if clip.path.stem in (other.path.stem for other in clips[:i]):
            raise InputError(f"{clip.path}: two clips are named {clip.path.stem}")
        if clip.scenario != first.scenario or len(clip.objects) != len(first.objects):
            raise InputError(
                f"{clip.path}: {clip.scenario} with {len(clip.objects)} objects, but {first.path}: "
                f"{first.scenario} with {len(first.objects)}; clips given together are trials of "
                "the same objects"
            )
        for one, other in zip(first.objects, clip.objects, strict=True):
            if one.mass_kg != other.mass_kg:
                raise InputError(
                    f"{clip.path}: {other.name}.mass_kg: {other.mass_kg}, but {first.path}: "
                    f"{one.mass_kg}; clips given together are trials of the same objects"
                )
    return clips


def inferred(measured: Sequence[Measured]) -> dict[str, Any]:
    """For a result's document: `{"inferred": {clip: {key: {mean, sd}}}}`, or nothing."""
    found = {
        one.name: {key: dict(value) for key, value in one.inferred.items()}
        for one in measured
        if one.inferred
    }
    return {"inferred": found} if found else {}


def measure(clip: Clip) -> Measured:
    """Tracks a clip's video, or reads its track, and infers what the model needs and is null.

    Raises:
      InputError: an object cannot be followed, or its path does not tell the ramp's angle or foot.
    """
    found: dict[str, Any] = {}
    if needs_foot(clip):
        clip = _with_foot(clip)
        found["origin_px"] = {"mean": list(clip.origin_px or ()), "sd": _foot_sd_px(clip)}
    measured = _with_slope(clip) if needs_slope(clip) else Measured(clip, _observed(clip))
    measured = _with_sizes(measured) if needs_sizes(measured.clip) else measured
    doubt = clock_doubt(measured.clip, measured.observation)
    if doubt is not None:
        _warn(doubt)
    doubts = () if doubt is None else (doubt,)
    measured = replace(
        measured, observation=_before_arrest(measured.clip, measured.observation), doubts=doubts
    )
    return replace(measured, inferred={**found, **measured.inferred})


def _with_foot(clip: Clip) -> Clip:
    """The clip with the foot of its ramp, from a first look at the path."""
    assert clip.pixels_per_metre is not None  # load_clips requires it of a ramp
    point = foot_of_path(clip, _observed(_without_sizes(clip, origin_px=(0.0, 0.0))))
    sign = 1.0 if clip.direction == "right" else -1.0
    x, y = (float(value) * clip.pixels_per_metre for value in point)
    origin = (round(sign * x, 1), round(-y, 1))
    clip = clip.model_copy(update={"origin_px": origin})
    _warn(
        f"{clip.path}: origin_px: null; {list(origin)} +- {_foot_sd_px(clip):.1f} is taken, from "
        f"the bend of {clip.objects[0].name}'s path"
    )
    return clip


def _foot_sd_px(clip: Clip) -> float:
    """As good as the point that was followed is the object's centre."""
    assert clip.pixels_per_metre is not None
    return round(SIZE_SD_M * clip.pixels_per_metre, 1)


def _without_sizes(clip: Clip, **update: Any) -> Clip:
    """For a first look: outlines are placed by what is not known yet."""
    unknown = tuple(item.model_copy(update={"size_m": None}) for item in clip.objects)
    return clip.model_copy(update={"objects": unknown, **update})


def _with_slope(clip: Clip) -> Measured:
    """A measurement with the ramp's angle from the path."""
    if clip.video is not None:
        # The object's outline stands along the ramp: a first look, without it, tells how steep.
        clip = _inclined(clip, slope_of_path(clip, _observed(_without_sizes(clip))))
    observation = _observed(clip)
    slope = slope_of_path(clip, observation)
    clip = _inclined(clip, slope)
    _warn(
        f"{clip.path}: ramp_angle_deg: null; {observation.names[0]}'s path falls by "
        f"{slope.angle_deg:.2f} +- {slope.sd_deg:.2f} degrees, which is taken"
    )
    found = {"mean": slope.angle_deg, "sd": slope.sd_deg}
    return Measured(clip, observation, {"ramp_angle_deg": found})


def _with_sizes(measured: Measured) -> Measured:
    """The measurement with sizes from the heights of the paths and the distance at the hit."""
    clip = measured.clip
    found = sizes_of_track(clip, measured.observation)
    objects = tuple(
        item.model_copy(update={"size_m": found.get(item.name, item.size_m)})
        for item in clip.objects
    )
    told = dict(measured.inferred)
    for name, size in found.items():
        _warn(f"{clip.path}: {name}: size_m: null; {list(size)} is taken, from its path")
        told[f"{name}.size_m"] = {"mean": list(size), "sd": SIZE_SD_M}
    clip = clip.model_copy(update={"objects": objects})
    return replace(measured, clip=clip, inferred=told)


def _warn(line: str) -> None:
    command.console().print(f"warning: {line}", soft_wrap=True, markup=False)


def _inclined(clip: Clip, slope: Slope) -> Clip:
    found = {"ramp_angle_deg": slope.angle_deg, "ramp_angle_sd_deg": slope.sd_deg}
    return clip.model_copy(update=found)


def _observed(clip: Clip) -> Observation:
    if clip.video is None:
        assert clip.track is not None  # load_clip requires one of the two
        return read_track(clip.path, clip.track, clip, clip.fps).observation
    from galileo_jax.tracking import track_clip

    with command.progress() as bar:
        return observe(clip, track_clip(clip, progress=bar))


def _before_arrest(clip: Clip, observation: Observation) -> Observation:
    """What is seen until something that is not in the scene stops the object."""
    observation, end_s = until_arrest(clip, observation)
    if end_s is not None:
        _warn(
            f"{clip.path}: {observation.names[0]} is stopped by something after {end_s:.3f} s; "
            "what follows is left out"
        )
    return observation
