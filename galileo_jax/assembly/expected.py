"""Centre and width of the priors that differ from clip to clip.

Of a scenario's parameters they are rough estimates from the track, many times wider than the
uncertainty of the fit. They are needed because a search must start near the answer: with a period
that is wrong by half, the misfit of an oscillation does not point towards the right one. Of the
declared angle, scale and origin they are how well the yaml says that these are known.
"""

import math
from collections.abc import Mapping, Sequence

import numpy as np

from galileo_jax.assembly.board_path import board_shape
from galileo_jax.assembly.level_starts import level_starts
from galileo_jax.clip.scenarios import SCENARIOS
from galileo_jax.clip.schema import Clip
from galileo_jax.clip.sizes import volume_m3
from galileo_jax.model.effects.air import expected_added_mass, expected_drags
from galileo_jax.model.effects.effect import FALL_LENGTH, ORIGIN, PENDULUM, SPIN
from galileo_jax.model.effects.laws.pendulum import ANGLE, LENGTH
from galileo_jax.model.effects.laws.spring import PERIOD
from galileo_jax.model.effects.laws.start_velocity import LAUNCH, StartVelocity
from galileo_jax.model.effects.nuisances.declared import DeclaredAngle, DeclaredScale
from galileo_jax.model.effects.nuisances.perspective import Perspective
from galileo_jax.numerics.least_squares import circle
from galileo_jax.numerics.periodogram import period_s
from galileo_jax.numerics.units import NOMINAL_SCALE_PX_PER_M
from galileo_jax.observation.observation import Observation

START_FRAMES = 6  # the start's velocity is read off so many
START_SD_M_S = 1.0
PERIOD_SD = 0.3  # of its logarithm
FLOOR_SD_M = 0.005  # as a declared height is known
UNKNOWN_RADIUS_M = 0.05  # half the height of an object whose size nobody declared
DENSITY_RATIO = (0.5, 0.8)  # steel in water 0.13, a bubble 800
WEIGHED_RATIO_SD = 0.03  # where density, mass and size are declared
EYE_M = 1.6  # as high as a camera is held
DISTANCE = 1.5  # of the camera from a high fall, in its lengths: it fills half of the picture
SPIN_SD_RAD_S, SPIN_SD_SHARE = 3.0, 0.03  # as a camera that looks at the ball's marks tells it
LAUNCH_SD_DEG = 0.5  # a launcher is set by a scale of degrees
UNKNOWN_M_S, UNKNOWN_M = 10.0, 3.0  # widths where nobody knows how long a metre is
MARK_PX = 5.0  # from a bob's middle, as a click may be, or a middle beside a hand
LENGTH_SD, ANGLE_SD_RAD = 0.3, 0.15  # of a thread's logarithm; of what the path tells
SPEED_SD = 0.3  # of the speed of a fall through the length
TAPE_M, PLACE_M = 0.002, 0.01  # how well a thread, and a pivot in the picture, are measured
WIDE_RAD = 0.3  # of a path whose circle shows where the pivot is


def expected(
    clip: Clip, observation: Observation, half_height_m: float
) -> Mapping[str, tuple[float, float]]:
    """The two numbers of each prior, by the parameter's name; of every law that might ask."""
    declared = _declared(clip)
    path = observation.path()
    times_s, place_m = path.times_s, path.place_m
    known = clip.is_scale_known
    if SCENARIOS[clip.scenario].has_ramp:
        if clip.starts_moving or StartVelocity.name in SCENARIOS[clip.scenario].laws:
            assert clip.ramp_angle_deg is not None  # the clip's own validation, or the path's
            angle, (x, y) = math.radians(clip.ramp_angle_deg), _start_velocity(times_s, place_m)
            speed = x * math.cos(angle) - y * math.sin(angle)
            declared["start_speed"] = (speed, START_SD_M_S) if known else (0.0, UNKNOWN_M_S)
        is_board = not SCENARIOS[clip.scenario].has_table
        return declared | (board_shape(clip, observation) if is_board else {})
    if SCENARIOS[clip.scenario].is_level:
        return declared | level_starts(observation, half_height_m, clip.walls)
    down_m = place_m[1, 0] - place_m[1]
    velocity = _start_velocity(times_s, place_m)
    middle = (float(down_m.min()) + float(down_m.max())) / 2
    width = float(np.ptp(down_m))

    def start(value: float) -> tuple[float, float]:
        return (value, START_SD_M_S) if known else (0.0, UNKNOWN_M_S)

    if PENDULUM in SCENARIOS[clip.scenario].laws:
        pendulum = declared | _pendulum(clip, times_s, place_m, velocity)
        is_filmed = observation.is_tracked_here
        return pendulum | _mark_off_thread(clip, pendulum) if is_filmed else pendulum
    return {
        "start_velocity_x": start(velocity[0]),
        "start_velocity_y": start(velocity[1]),
        **({"start_velocity_z": start(velocity[2])} if len(velocity) == 3 else {}),
        "start_speed": start(-velocity[1]),
        "rest": (middle, max(width, 0.01)) if known else (0.0, UNKNOWN_M),
        PERIOD: (period_s(times_s, down_m), PERIOD_SD),
        "density_ratio": _density_ratio(clip),
        "floor_height": _floor_height(clip, place_m[1], half_height_m),
        **declared,
        **_launcher(clip),
        **_spin(clip),
        **(_drag_in_space(clip, velocity) if len(velocity) == 3 else {}),
        **(_high_fall(clip, float(down_m.max())) if clip.scenario == "fall" and known else {}),
    }


def _declared(clip: Clip) -> dict[str, tuple[float, float]]:
    """How well angle, scale and origin are known, and the air that comes along.

    Nothing of what is taken at its word.
    """
    in_plane = SCENARIOS[clip.scenario].moves_in_plane
    angle_sd_deg = clip.vertical_sd_deg if in_plane else clip.ramp_angle_sd_deg
    scale = clip.pixels_per_metre or NOMINAL_SCALE_PX_PER_M
    sds = {
        DeclaredAngle.name: math.radians(angle_sd_deg),
        DeclaredScale.name: (clip.pixels_per_metre_sd or 0.0) / scale,
        ORIGIN: clip.origin_sd_px / scale,
    }
    return {name: (0.0, sd) for name, sd in sds.items() if sd} | _carried_air(clip)


def _carried_air(clip: Clip) -> dict[str, tuple[float, float]]:
    """The air that a ball of declared size and mass carries along; nothing of others."""
    size_m, mass_kg = clip.objects[0].size_m, clip.objects[0].mass_kg
    is_ball = clip.objects[0].shape == "sphere"
    if not is_ball or size_m is None or mass_kg is None or clip.scenario == "liquid":
        return {}
    return expected_added_mass(size_m[0], mass_kg)


def _spin(clip: Clip) -> dict[str, tuple[float, float]]:
    """The measured spin along the observation's axes; nothing where it is not known."""
    given = clip.objects[0].spin_rad_s
    if given is None:
        return {}
    x, y, z = given
    turned = (x, z, -y) if clip.track_up == "z" else (x, y, z)
    sd = SPIN_SD_RAD_S + SPIN_SD_SHARE * math.hypot(*given)
    return {f"{SPIN}_{axis}": (value, sd) for axis, value in zip("xyz", turned, strict=True)}


def _launcher(clip: Clip) -> dict[str, tuple[float, float]]:
    """The declared angle of a launcher; nothing where there is none."""
    if clip.launch_angle_deg is None:
        return {}
    return {LAUNCH: (math.radians(clip.launch_angle_deg), math.radians(LAUNCH_SD_DEG))}


def _drag_in_space(clip: Clip, velocity_m_s: Sequence[float]) -> dict[str, tuple[float, float]]:
    """What the air does to a ball of declared size that several cameras follow; else nothing."""
    ball, speed = clip.objects[0], float(np.linalg.norm(velocity_m_s))
    if clip.scenario != "flight" or ball.shape != "sphere" or ball.size_m is None:
        return {}
    return expected_drags(ball.size_m[0], speed**2 / clip.gravity, clip.gravity)


def _high_fall(clip: Clip, length_m: float) -> dict[str, tuple[float, float]]:
    """How a high fall is seen, and what the air does there; nothing where it is low."""
    found, declared = pitched(length_m), clip.objects[0]
    if found and declared.shape == "sphere" and declared.size_m is not None:
        found |= expected_drags(declared.size_m[0], length_m, clip.gravity)
    return found


def pitched(length_m: float) -> dict[str, tuple[float, float]]:
    """What a camera that is held at eye height and aimed at the middle of a fall makes of it.

    Nothing where the fall is so low that its middle can be at eye height. Else the camera looks
    up (or, from where the fall begins, down) by atan t, and the scale changes along the fall by
    p = t / (DISTANCE (1 + t^2)).
    """
    above_m = length_m / 2 - EYE_M
    if above_m <= 0:
        return {}
    slope = above_m / (DISTANCE * length_m)
    change = slope / (DISTANCE * (1 + slope**2))
    return {Perspective.name: (0.0, change), FALL_LENGTH: (length_m, 0.0)}


def _start_velocity(times_s: np.ndarray, place_m: np.ndarray) -> tuple[float, ...]:
    """The velocity `[axis]` in the first frame, m/s, from a parabola through the first few."""
    count = min(len(times_s), START_FRAMES)
    if count < 2:
        return (0.0,) * len(place_m)
    after = times_s[:count] - times_s[0]
    return tuple(float(np.polyfit(after, row[:count], min(2, count - 1))[-2]) for row in place_m)


def _pendulum(
    clip: Clip, times_s: np.ndarray, place_m: np.ndarray, velocity: tuple[float, ...]
) -> dict[str, tuple[float, float]]:
    """A pendulum's length, its angle and its speed along the circle at the start.

    The period tells the length in metres, whatever the scale; the circle that the path is on the
    angle, or where it is too short for that its middle. `velocity`: in the first frame, m/s.
    """
    x, y = place_m[0], place_m[1]
    length = clip.gravity * (period_s(times_s, x) / (2 * math.pi)) ** 2
    length_sd = LENGTH_SD
    centre, radius, _ = circle(x, y)
    angles = np.arctan2(x - centre[0], centre[1] - y)
    angle, angle_sd = float(angles[0]), ANGLE_SD_RAD
    if np.ptp(angles) < WIDE_RAD or not math.isfinite(radius):
        middle = 0.5 * (float(x.min()) + float(x.max()))
        radius = length if clip.is_scale_known else max(10 * float(np.ptp(x)), 1e-3)
        angle = math.asin(min(max((float(x[0]) - middle) / radius, -1.0), 1.0))
    if clip.pivot_m is not None and clip.is_scale_known:
        aside, above = x[0] - clip.pivot_m[0], clip.pivot_m[1] - y[0]
        length = radius = float(np.hypot(aside, above))
        angle, angle_sd = float(np.arctan2(aside, above)), PLACE_M / radius
        length_sd = PLACE_M / length
    if clip.thread_m is not None:
        length, length_sd = clip.thread_m, TAPE_M / clip.thread_m
    along = velocity[0] * math.cos(angle) + velocity[1] * math.sin(angle)
    fall = math.sqrt(2 * clip.gravity * length)
    return {
        LENGTH: (length, length_sd),
        ANGLE: (angle, angle_sd),
        "start_speed": (along * length / radius, SPEED_SD * fall),
    }


def _mark_off_thread(
    clip: Clip, pendulum: Mapping[str, tuple[float, float]]
) -> dict[str, tuple[float, float]]:
    """How far the picture's vertical may seem to be off, where a mark on the bob was followed.

    What is beside the thread's line turns with the thread: by so much the plumb line seems turned.
    """
    scale = clip.pixels_per_metre or NOMINAL_SCALE_PX_PER_M
    aside_rad = MARK_PX / (scale * pendulum[LENGTH][0])
    return {DeclaredAngle.name: (0.0, math.hypot(math.radians(clip.vertical_sd_deg), aside_rad))}


def _density_ratio(clip: Clip) -> tuple[float, float]:
    """Liquid over object: the middle and the width of its logarithm."""
    declared = clip.objects[0]
    volume = volume_m3(declared)
    if clip.liquid_density is None or declared.mass_kg is None or volume is None:
        return DENSITY_RATIO
    return clip.liquid_density * volume / declared.mass_kg, WEIGHED_RATIO_SD


def _floor_height(clip: Clip, y_m: np.ndarray, half_height_m: float) -> tuple[float, float]:
    """How high the centre is when the object touches the floor, y as measured.

    Where it is not declared: a little below the lowest place seen, by what the object goes
    from frame to frame there.
    """
    if isinstance(clip.floor, float):
        if clip.objects[0].size_m is None:
            return clip.floor + UNKNOWN_RADIUS_M / 2, UNKNOWN_RADIUS_M / 2
        return clip.floor + half_height_m, FLOOR_SD_M
    lowest = int(np.argmin(y_m))
    near = y_m[max(lowest - 1, 0) : lowest + 2]
    step = float(np.ptp(near)) + FLOOR_SD_M
    return float(y_m[lowest]) - step / 4, step / 2
