"""A frame rate that is wrong by a factor, from the gravity that a clip would have.

    gravity by the path = true gravity x (true rate / declared rate)^-2

In a fall or a flight gravity is what the path bends by. On a ramp with a table it is
(a + d cos A) / sin A, a the acceleration down the ramp, d the deceleration on the table: constant
friction drops out. Without a table only a / sin A is available; friction lowers it, so only values
that are too large are reported. Effects that were not declared change gravity by tens of per cent,
a wrong frame rate by the square of its factor. Only large factors are therefore reported.
"""

import math
from dataclasses import dataclass

import numpy as np

from galileo_jax.clip.scenarios import SCENARIOS
from galileo_jax.clip.schema import Clip
from galileo_jax.clip.track_axes import accelerations
from galileo_jax.observation.observation import Observation
from galileo_jax.table.track_table import METRES_PER_UNIT

LEAST_FACTOR = 1.6  # of the frame rate, that is reported; half the friction or rolling gives 1.4
LEAST_FACTOR_FREE = 1.4  # too few frames of what touches nothing: nothing else falls so fast
SURE_SDS = 4.0  # by which gravity must be off
UNIT_WITHIN = 0.08  # of gravity: nearer another unit of length is the likely mistake
PIXELS_FROM = 20.0  # times gravity: no unit of length, but pixels
NEAR = 1.25  # a rate that is so near what gravity says is the likely one
COMMON_FPS = (24, 25, 29.97, 30, 48, 50, 59.94, 60, 90, 100, 120, 240, 300, 480, 500, 960, 1000)
MIN_POINTS = 5  # of a stretch, to tell an acceleration
BEND_M = 0.05  # past the foot on either side, in which an object turns
LEAST_WAY_M = 0.03  # on the table, to tell how it slows down
MOVED_M = 0.003  # of the second object: it has been hit


@dataclass(frozen=True)
class ApparentGravity:
    """What gravity would be by the path, m/s^2.

    Attributes:
      value: the estimate.
      sd: its standard deviation; 0 where it is not known.
      is_least: whether it can only be more: friction is not known.
    """

    value: float
    is_least: bool = False
    sd: float = 0.0


def frame_rate_doubt(clip: Clip, observation: Observation) -> str | None:
    """One line where the frame rate is off by a factor, with the likely one; None elsewhere."""
    found = apparent_gravity(clip, observation)
    if found is None or found.value <= 0:
        return None
    factor = math.sqrt(clip.gravity / found.value)  # of the true rate over the declared one
    is_free = SCENARIOS[clip.scenario].up_shows == "bend"
    least = LEAST_FACTOR_FREE if is_free and factor < 1 else LEAST_FACTOR
    if max(factor, 1 / factor) < least or (found.is_least and factor > 1):
        return None
    if abs(found.value - clip.gravity) < SURE_SDS * found.sd:
        return None
    likely = _likely(clip.fps * factor, clip.container_fps, found.is_least)
    if (unit := _likely_unit(clip, found.value)) is not None:
        nearest = min(abs(math.log(fps / clip.fps / factor)) for fps in COMMON_FPS)
        words, off = unit
        likely = f"likely {words}" if off < 2 * nearest else f"{likely} (or {words})"
    name, more = observation.names[0], "at least " if found.is_least else ""
    error = f" +- {found.sd:.1g}" if found.sd else ""
    doubt = (
        f"{clip.path}: fps: {clip.fps:g}, but from {name}'s path gravity would be {more}"
        f"{found.value:.3g}{error} m/s^2, not {clip.gravity:g}; {likely}"
    )
    if clip.pixels_per_metre is not None:
        scale = clip.pixels_per_metre * found.value / clip.gravity
        doubt += f" (or pixels_per_metre is off: {scale:.3g} in place of {clip.pixels_per_metre:g})"
    return doubt


def apparent_gravity(clip: Clip, observation: Observation) -> ApparentGravity | None:
    """What gravity would be by the first object's path; None where it does not tell."""
    scenario = SCENARIOS[clip.scenario]
    if not clip.is_scale_known:
        return None
    seen = observation.mask[0]
    times, (x, y) = observation.times_s[seen], observation.position_m[0, :2][:, seen]
    if clip.scenario in ("fall", "flight"):
        windows = accelerations(times, -y)
        found = _largest(windows)
        return None if found is None else ApparentGravity(found, sd=_sd(windows, found))
    if not scenario.has_ramp or not clip.ramp_angle_deg or times.size < MIN_POINTS:
        return None
    angle = math.radians(clip.ramp_angle_deg)
    along = x * math.cos(angle) - y * math.sin(angle)
    on_ramp = x < -BEND_M if scenario.has_table else np.ones(x.shape, bool)
    down = _largest(accelerations(times[on_ramp], along[on_ramp]))
    if down is None:
        return None
    slowing = _slowing(observation) if scenario.has_table else None
    if slowing is None:
        return ApparentGravity(down / math.sin(angle), is_least=True)
    return ApparentGravity((down + slowing * math.cos(angle)) / math.sin(angle))


def _likely_unit(clip: Clip, value: float) -> tuple[str, float] | None:
    """The unit of length in which a track's gravity is the true one, and how far off it is then.

    The logarithm of the ratio; infinite of pixels, of which any scale is right. None: no unit.
    """
    if clip.track is None or clip.track_units == "px":
        return None
    key = "its columns in" if clip.is_own_track else "track_units:"
    pixels = f"{key} px with {value / clip.gravity:.4g} pixels per metre"
    are_pixels = value > PIXELS_FROM * clip.gravity
    declared = METRES_PER_UNIT[clip.track_units or "m"]
    off = {
        unit: abs(math.log(value * metres / declared / clip.gravity))
        for unit, metres in METRES_PER_UNIT.items()
    }
    best = min(off, key=lambda unit: off[unit])
    if off[best] > UNIT_WITHIN:
        return (pixels, math.inf) if are_pixels else None
    would_be = value * METRES_PER_UNIT[best] / declared
    words = f"{key} {best}, with which it would be {would_be:.3g} m/s^2"
    return f"{words}, or {pixels}" if are_pixels else words, off[best]


def _sd(windows: np.ndarray, value: float) -> float:
    """How well the middle of the windows' accelerations is known."""
    return 1.4826 * float(np.median(np.abs(windows - value))) / math.sqrt(len(windows) / 2)


def _likely(wanted_fps: float, container_fps: float | None, is_most: bool) -> str:
    """The rate that is meant: the container's or a common one, where one is near."""

    def distance(fps: float) -> float:
        return abs(math.log(fps / wanted_fps))

    # Friction makes the ramp's acceleration, and with it the true rate, smaller than that.
    near = math.log(NEAR * 2 if is_most else NEAR)
    if container_fps and distance(container_fps) < near:
        return f"likely fps: {container_fps:.4g}, as the container says"
    best = min(COMMON_FPS, key=distance)
    if is_most:
        return f"likely fps: {best:g} or less"
    if distance(best) < near:
        return f"likely fps: {best:g}"
    return "no usual rate explains that: check the unit of length, the axes and what was followed"


def _largest(accelerations: np.ndarray) -> float | None:
    """The usual one while it moves: of those that are not far below the largest, the middle."""
    if not accelerations.size:
        return None
    top = float(np.quantile(accelerations, 0.9))
    return float(np.median(accelerations[accelerations >= 0.5 * top])) if top > 0 else None


def _slowing(observation: Observation) -> float | None:
    """The first object's deceleration on the table, up to the hit or else after it."""
    seen, times = observation.mask[0], observation.times_s
    x = observation.position_m[0, 0]
    on_table = seen & (np.where(seen, x, -np.inf) > BEND_M)
    hit = _moved_off(observation)
    for stretch in (on_table & (times < hit), on_table & (times > hit)):
        chosen = np.flatnonzero(stretch)
        speed = np.gradient(x[chosen], times[chosen]) if chosen.size > 1 else np.zeros(0)
        if speed.size and speed.max() > 0:
            # What has come to rest slows down no more.
            chosen = chosen[speed > 0.1 * speed.max()]
        if chosen.size < MIN_POINTS or np.ptp(x[chosen]) < LEAST_WAY_M:
            continue
        return max(0.0, -2 * float(np.polyfit(times[chosen] - times[chosen[0]], x[chosen], 2)[0]))
    return None


def _moved_off(observation: Observation) -> float:
    """When the second object has been hit, s; inf where it never is."""
    if len(observation.names) < 2 or not observation.mask[1].any():
        return math.inf
    x = np.where(observation.mask[1], observation.position_m[1, 0], np.nan)
    first = x[np.flatnonzero(observation.mask[1])[0]]
    moved = np.flatnonzero(np.abs(x - first) > MOVED_M)
    return float(observation.times_s[max(moved[0] - 1, 0)]) if moved.size else math.inf
