"""The scene that a clip and its observation set: geometry, starts, and what is expected."""

import math
from collections.abc import Sequence

import numpy as np

from galileo_jax.assembly.expected import expected
from galileo_jax.clip.scenarios import SCENARIOS
from galileo_jax.clip.schema import Clip
from galileo_jax.clip.sizes import extents, rolling
from galileo_jax.model.effects.effect import PENDULUM, SPRING, Surroundings
from galileo_jax.model.effects.laws.pendulum import ANGLE, LENGTH
from galileo_jax.model.effects.laws.spring import PERIOD
from galileo_jax.model.effects.laws.start_velocity import StartVelocity
from galileo_jax.model.effects.laws.walls import StraightWalls
from galileo_jax.model.model import SUBSTEPS
from galileo_jax.model.scene.scene import TIMESTEP_S, Scene, laid_out, on_ramp
from galileo_jax.observation.observation import Observation
from galileo_jax.runtime.errors import InputError

EARLY_SHARE = 0.3  # of a fall, before the air makes itself felt; of a way that turns back
FEWEST = 3  # places that tell when it was let go
STEPS_A_SWING = 150
TURNED = 0.99  # of its way, where what ended nearer has turned back


def build_scene(clip: Clip, observation: Observation) -> Scene:
    """Sets `scenes/ramp.xml` to the clip: angle, sizes, start positions, gravity.

    Object 1 starts on the ramp where it is first seen (projected onto the surface), every
    other object on the table, in the order of the travel. `incline` is the same scene without
    the table; `fall` (and a spring, a liquid) is an incline straight down, without a board; in
    the plane of a `flight`, and on a table seen from above, there is no path to begin with.

    Raises:
      InputError: an object is never seen, or one stands before the one declared before it.
    """
    scenario = SCENARIOS[clip.scenario]
    if scenario.has_ramp:
        assert clip.ramp_angle_deg is not None  # the clip's own validation
        angle = math.radians(clip.ramp_angle_deg)
    else:
        angle = 0.0 if scenario.moves_in_plane else math.pi / 2
    half = [extents(declared) for declared in clip.objects]
    starts = _starts(clip, observation, [height for _, height in half], angle)
    surroundings = Surroundings(
        names=observation.names,
        angle_rad=angle,
        gravity=clip.gravity,
        **laid_out(half, starts, angle, scenario.has_table),
        release_s=_release(clip, observation, angle),
        is_scale_known=clip.is_scale_known,
        is_scale_stated=clip.pixels_per_metre_sd is not None,
        has_surface=scenario.has_surface,
        mass_kg=tuple(declared.mass_kg for declared in clip.objects),
        **(rolling(clip.objects) if scenario.has_ramp else {}),
        is_box=tuple(declared.shape == "box" for declared in clip.objects),
        moves_in_plane=scenario.moves_in_plane,
        laws=laws_of(clip),
        expected=expected(clip, observation, half[0][int(not scenario.is_level)]),
        walls_m=tuple(wall.ends_m for wall in clip.walls),
        way_m=float(np.hypot(*np.ptp(observation.path().place_m[:2], axis=1))),
    )
    return Scene(surroundings, clip.objects, _timestep_s(surroundings))


def _timestep_s(scene: Surroundings) -> float:
    """MuJoCo's own step, s; of what swings slowly two to four times as long.

    `STEPS_A_SWING` recorded steps are off by 1e-10 of the amplitude a swing.
    """
    swing_s = 0.0
    if SPRING in scene.laws:
        swing_s, _ = scene.expected[PERIOD]
    elif PENDULUM in scene.laws:
        (length_m, _), (angle, _) = scene.expected[LENGTH], scene.expected[ANGLE]
        # The wider it swings the longer it hesitates at its top, and the more an error grows there.
        swing_s = 2 * math.pi * math.sqrt(length_m / scene.gravity) * abs(math.cos(angle / 2))
    longest_s = swing_s / (STEPS_A_SWING * SUBSTEPS)
    return TIMESTEP_S * max((n for n in (2, 3, 4) if n * TIMESTEP_S <= longest_s), default=1)


def _starts(
    clip: Clip, observation: Observation, heights_m: Sequence[float], angle: float
) -> tuple[tuple[float, ...], ...]:
    """The centres at the start, of objects of half these heights; raises as `build_scene`."""
    starts: list[tuple[float, ...]] = []
    for i, (name, height) in enumerate(zip(observation.names, heights_m, strict=True)):
        seen = np.flatnonzero(observation.mask[i])
        if not seen.size:
            raise InputError(f"{clip.path}: {name} is not seen in any frame")
        x, y = observation.position_m[i, :2, seen[0]]
        if not SCENARIOS[clip.scenario].has_table:
            starts.append(tuple(map(float, observation.position_m[i, :, seen[0]])))
        elif i == 0:
            along = x * math.cos(angle) - y * math.sin(angle)
            starts.append(on_ramp(along, height, angle))
        else:
            starts.append((float(x), height))
            if x < starts[i - 1][0]:
                raise InputError(
                    f"{clip.path}: objects[{i}]: {name} stands before {observation.names[i - 1]}; "
                    "objects in the order of the travel expected"
                )
    return tuple(starts)


def laws_of(clip: Clip) -> tuple[str, ...]:
    """The scenario's laws, and those that the clip's keys bring."""
    declared = (
        ("floor", clip.has_floor),
        (StartVelocity.name, clip.starts_moving is True),
        (StraightWalls.name, bool(clip.walls)),
    )
    return SCENARIOS[clip.scenario].laws + tuple(name for name, is_there in declared if is_there)


def _release(clip: Clip, observation: Observation, angle: float) -> tuple[float, float]:
    """When object 1 is let go: expected, and its standard deviation, s.

    On a ramp clip it is the first frame, within a third of a frame, unless that is declared to
    be unknown. On others it is where the motion begins: from rest the distance grows as
    (t - release)^2, so that its root is a straight line which meets zero at the release.
    """
    steps_s = np.diff(observation.times_s)
    frame_s = float(np.median(steps_s)) if steps_s.size else 1.0 / clip.fps
    declared = clip.objects[0].first_frame
    if StartVelocity.name in laws_of(clip) or SCENARIOS[clip.scenario].is_level:
        return float(observation.times_s[np.argmax(observation.mask[0])]), frame_s
    if clip.scenario == "ramp" and declared is not None:
        return float(observation.times_s[declared]), frame_s / 3
    path = observation.path()
    times, place, (x, y, *_) = path.times_s, path.place_m, path.gone_m
    gone = x * math.cos(angle) - y * math.sin(angle)
    if SCENARIOS[clip.scenario].has_table:
        gone = np.where(place[0] < 0, gone, 0.0)
    moving = gone > 0.05 * gone.max()
    if clip.scenario == "fall" or gone[-1] < TURNED * gone.max():
        moving &= np.arange(len(gone)) <= np.argmax(gone)  # it may come back up
        early = moving & (gone < EARLY_SHARE * gone.max())
        moving = early if early.sum() >= FEWEST else moving  # it may be out of sight at first
    if gone.max() <= 0 or moving.sum() < FEWEST:
        return float(times[0]), frame_s
    slope, intercept = np.polyfit(times[moving], np.sqrt(gone[moving]), 1)
    if slope <= 0:
        return float(times[0]), frame_s
    release = float(np.clip(-intercept / slope, times[0], times[-1]))
    return release, max(3 * frame_s, 0.05)
