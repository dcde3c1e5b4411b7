"""`simulate`: a clip with known truth, or a series of them."""

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

from galileo_jax.api.options import options_of
from galileo_jax.runtime import progress
from galileo_jax.runtime.errors import InputError
from galileo_jax.runtime.lazy import pd
from galileo_jax.runtime.precision import in_float64
from galileo_jax.simulation.clip_files import TRUTH_SUFFIX, YAML_SUFFIX
from galileo_jax.simulation.clip_writer import write_clips
from galileo_jax.simulation.motion import Solver
from galileo_jax.simulation.settings import Settings

Effects = Mapping[str, Mapping[str, float]] | Sequence[str]


@dataclass(frozen=True)
class Simulated:
    """What `simulate` wrote.

    Attributes:
      clips: the videos or csv tracks, one per trial; `load` takes each.
      truths: what is true of each, as in its NAME.truth.json (SI units, angles in degrees).
      paths: every file written: of each clip the video or track, the yaml, the truth.
    """

    clips: tuple[Path, ...]
    truths: tuple[dict[str, Any], ...]
    paths: tuple[Path, ...]

    def __repr__(self) -> str:
        return f"<Simulated {', '.join(str(clip) for clip in self.clips)}>"

    def _repr_html_(self) -> str:
        columns = {"scenario": "scenario", "effect": "hidden effect"}
        rows = pd.DataFrame(self.truths, [str(clip) for clip in self.clips])
        return rows[[*columns]].rename(columns=columns)._repr_html_()  # pyright: ignore


@in_float64
def simulate(
    out: str | Path,
    *,
    seed: int = 0,
    scenario: str = "ramp",
    shapes: Sequence[str] | None = None,
    angle: float = 20.0,
    seconds: float | None = None,
    fps: float = 30.0,
    m1: float | None = None,
    k1: float | None = None,
    m2: float | None = None,
    k2: float | None = None,
    motion: Literal["planar", "free"] = "planar",
    z2: float | None = None,
    solver: Solver = "rigid",
    values: Mapping[str, float] | None = None,
    floor: bool = False,
    walls: bool = False,
    release: float | None = None,
    like: str | Path | None = None,
    series: int | None = None,
    track_only: bool = False,
    track_noise: float = 0.0002,
    effects: Effects = (),
    strength: float | None = None,
    effects_from: str | Path | Sequence[str | Path] = (),
    faults: bool = False,
    size: tuple[int, int] = (640, 360),
    direction: Literal["right", "left"] = "right",
    no_points: bool = False,
    hand: bool = False,
    camera_fault: str | Sequence[str] = (),
    noise: float = 4.0,
    exposure: float = 0.008,
    defocus: float = 0.0,
    missed_frames: int = 0,
    on_progress: progress.OnProgress | None = None,
    cancel: progress.CancelFlag | None = None,
) -> Simulated:
    """Makes a clip with known truth: NAME.mp4 (or NAME.csv), NAME.yaml and NAME.truth.json.

    What is not given is drawn at random; the same seed makes the same files. Either all files
    are written or none.

    Args:
      out: DIR/NAME.mp4, or DIR/NAME.csv for a track.
      seed: of all random numbers, 0 or more.
      scenario: "ramp", "multi" or "incline"; "fall", "flight", "spring", "liquid",
        "pendulum" or "from_above".
      shapes: of the objects on a ramp, in the order of the travel (box, cylinder, torus,
        sphere); round ones roll. None: as many boxes as the scenario has.
      angle: of the ramp, degrees, 1 to 60.
      seconds: length of the clip, s. None: until everything is at rest.
      fps: frames per second, 5 to 1000.
      m1: mass of object 1, kg, 0.01 to 100. None: drawn.
      k1: coefficient of friction of object 1, 0 to 2. None: drawn.
      m2: mass of object 2, kg. None: drawn.
      k2: coefficient of friction of object 2. None: drawn.
      motion: "planar"; "free": objects that are hit turn and tip (tracks only).
      z2: how far object 2 stands off the plane of the motion, towards the camera, m (free
        motion only).
      solver: "rigid": the engine that also fits; "fine": an independent one with small steps.
      values: further parameters of the scenario, such as {"k3": 0.2} or
        {"floor_restitution": 0.7}, SI units (the command's --set).
      floor: of a fall or a flight: the object bounces.
      walls: of pucks seen from above: four walls stand round them, off which they bounce.
      release: of a ramp: how far up it object 1 is released, from the foot to the point under its
        centre, m. None: drawn.
      like: NAME.truth.json of a clip on a ramp: the same objects in the same places, and what was
        hidden, filmed once more at this call's angle, frame rate, release and noise. None: other
        objects.
      series: number of trials of the same objects: NAME_1, NAME_2, ...
      track_only: a csv track in place of the video.
      track_noise: standard deviation of a track's coordinates, m.
      effects: what is hidden (written to the truth, not to the yaml): names, or name to
        {parameter: value} in SI units; what is left out is drawn (the command's --effect).
      strength: of the hidden effects, 0 (weak) to 1 (strong). None: drawn.
      effects_from: Python files that register further effects.
      faults: small faults of real clips: release between frames, foot and impact not ideal.
      size: of the picture, (width, height), px, even numbers.
      direction: of the travel in the picture, "right" or "left".
      no_points: the yaml does not say where the objects are.
      hand: a hand lets object 1 go.
      camera_fault: keystone, roll, hand_held (how the camera is held), origin, points (of the
        yaml, off by a few px); one or several.
      noise: of the sensor, grey levels of 255.
      exposure: of a frame, s.
      defocus: standard deviation of the blur, px.
      missed_frames: so many frames show the one before once more.
      on_progress: called with the stage, the share done (0 to 1) and None.
      cancel: a flag with `is_set`, such as `threading.Event`.

    Returns:
      The files and what is true of them.

    Raises:
      InputError: a value is out of its range, an option has no part in the clip asked for, or
        a file cannot be written; nothing is written then.
      Cancelled: `cancel` was set; nothing is written.

    Examples:
      >>> import galileo_jax as gx
      >>> made = gx.simulate("slide.csv", seed=1, m1=0.2, track_only=True)
      >>> made
      <Simulated slide.csv>
      >>> made.truths[0]["m1"]
      0.2
    """
    one_file = isinstance(effects_from, str | Path)
    settings = options_of(
        Settings,
        locals(),
        effects=_by_name(effects),
        effects_from=(effects_from,) if one_file else effects_from,
        camera_fault=(camera_fault,) if isinstance(camera_fault, str) else camera_fault,
    )
    with progress.scope(on_progress, cancel):
        clips = write_clips(Path(out), settings)
    truths = [clip.with_suffix(TRUTH_SUFFIX) for clip in clips]
    return Simulated(
        clips=clips,
        truths=tuple(json.loads(truth.read_text(encoding="utf-8")) for truth in truths),
        paths=tuple(
            path
            for clip, truth in zip(clips, truths, strict=True)
            for path in (clip, clip.with_suffix(YAML_SUFFIX), truth)
        ),
    )


def _by_name(effects: Effects) -> Mapping[str, Mapping[str, float]]:
    """Parameters by effect; a name alone has none given."""
    if isinstance(effects, Mapping):
        return effects
    names = (effects,) if isinstance(effects, str) else tuple(effects)
    if len(set(names)) < len(names):
        raise InputError("--effect: an effect is named twice")
    return {name: {} for name in names}
