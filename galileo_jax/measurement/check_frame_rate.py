"""A frame rate or a unit that is wrong by a factor, from the gravity that a clip would have.

    gravity by the path = true gravity x (true rate / declared rate)^-2 x declared unit / true unit

In a fall or a flight gravity is what the path bends by. On a ramp with a table it is
(a + d cos A) / sin A, a the acceleration down the ramp, d the deceleration on the table: constant
friction drops out. Without a table only a / sin A is available, and on the level only d / 1;
friction lowers the one and is hardly more than 1 in the other, so only values that are too large
are reported. Of a pendulum it is L (2 pi / T)^2 with the thread L, declared or its arc's radius.
Effects that were not declared change gravity by tens of per cent, a wrong frame rate by the square
of its factor. Only large factors are therefore reported.
"""

import math
from typing import NamedTuple

import numpy as np

from galileo_jax.clip.scenarios import SCENARIOS
from galileo_jax.clip.schema import Clip
from galileo_jax.clip.track_axes import accelerations
from galileo_jax.measurement.infer_ramp import LEVEL_SD_DEG
from galileo_jax.numerics.least_squares import circle, polynomial
from galileo_jax.numerics.periodogram import period_s, sine_through
from galileo_jax.observation.observation import Observation
from galileo_jax.table.track_table import METRES_PER_UNIT

LEAST_FACTOR = 1.6  # of the frame rate, that is reported; half the friction or rolling gives 1.4
LEAST_FACTOR_FREE = 1.4  # of what touches nothing and feels no drag: only scale and clock do that
SURE_SDS = 4.0  # by which gravity must be off
UNIT_WITHIN = 0.08  # of gravity: nearer another unit of length is the likely mistake
CLEARLY_NEARER = 0.5  # of the way to another explanation
PIXELS_FROM = 20.0  # times gravity: no unit of length, but pixels
LEAST_SHARE = 1 / PIXELS_FROM**2  # of gravity that rough friction leaves in another unit
NEAR = 1.25  # a rate that is so near what gravity says is the likely one
NEAR_FREE = 1.05  # the same of what nothing brakes: a scale is known to some per cent
COMMON_FPS = (15, 24, 25, 29.97, 30, 48, 50, 59.94, 60, 90, 100, 120, 240, 300, 480, 500, 960, 1000)
THREAD_OFF = 0.25  # of its length: a mark may lie beside the bob's middle
MIN_POINTS = 5  # of a stretch, to tell an acceleration
CHANCE = 1e-3  # that a path is called no parabola though it is one
LEVELS_OFF = 4.0  # times what it falls faster by in the end: a drag has made it so little
SINE = 0.3  # of its scatter is what a sine leaves of a swing at most
BEND_M = 0.05  # past the foot on either side, in which an object turns
LEAST_WAY_M = 0.03  # on the table, to tell how it slows down


class ApparentGravity(NamedTuple):
    """What gravity would be by the path, m/s^2."""

    value: float  # the estimate
    is_least: bool = False  # whether it can only be more: friction is not known
    sd: float = 0.0  # its standard deviation; 0 where it is not known
    is_parabola: bool = False  # whether the path is one: no drag makes gravity seem less


def frame_rate_doubt(clip: Clip, observation: Observation) -> str | None:
    """One line where the frame rate is off by a factor, with the likely one; None elsewhere."""
    found = apparent_gravity(clip, observation)
    if found is None or found.value <= 0:
        return None
    factor = math.sqrt(clip.gravity / found.value)  # of the true rate over the declared one
    is_free = SCENARIOS[clip.scenario].up_shows == "bend"
    least = LEAST_FACTOR_FREE if is_free and (factor < 1 or found.is_parabola) else LEAST_FACTOR
    if max(factor, 1 / factor) < least or (found.is_least and factor > 1):
        return None
    if abs(found.value - clip.gravity) < SURE_SDS * found.sd:
        return None
    likely = _likely(clip, factor, found)
    if (unit := _likely_unit(clip, found)) is not None:
        # Gravity goes with the rate's square. What is ten times off fits cm as well as a rate.
        nearest = 2 * min(abs(math.log(fps / clip.fps / factor)) for fps in COMMON_FPS)
        words, off = unit
        is_nearer = off < CLEARLY_NEARER * nearest
        # Who writes times beside places has seldom got these wrong.
        first, second = (f"likely {words}", likely) if found.is_least else (likely, words)
        likely = (
            f"likely {words}" if is_nearer else f"{first} (or {second.removeprefix('likely ')})"
        )
    name, more = observation.names[0], "at least " if found.is_least else ""
    error = f" +- {found.sd:.1g}" if found.sd else ""
    doubt = (
        f"{clip.path}: fps: {clip.fps:.4g}, but from {name}'s path gravity would be {more}"
        f"{found.value:.3g}{error} m/s^2, not {clip.gravity:g}; {likely}"
    )
    if clip.pixels_per_metre is not None:
        scale = clip.pixels_per_metre * found.value / clip.gravity
        doubt += f" (or pixels_per_metre is off: {scale:.3g} in place of {clip.pixels_per_metre:g})"
    return doubt


def speed_doubt(clip: Clip, observation: Observation) -> str | None:
    """One line where one object speeds up by more than its slope can; None elsewhere.

    By a parabola in time along its way: a > g sin A, which friction only lowers, by `SURE_SDS`
    standard deviations of a and of the slope's angle. On the level g sin A is 0.
    """
    scenario, path = SCENARIOS[clip.scenario], observation.path()
    is_asked = scenario.has_ramp and not scenario.has_table and clip.is_scale_known
    if not is_asked or clip.ramp_angle_deg is None or len(path) <= MIN_POINTS:
        return None
    furthest = path.gone_m[:, path.farthest]
    if not furthest.any():
        return None
    way_m = furthest @ path.gone_m / np.hypot(*furthest)
    fit = polynomial(path.times_s - path.times_s[0], way_m, 2)
    found, sd, angle = 2 * float(fit.solution[0]), 2 * float(fit.sds[0]), clip.ramp_angle_deg
    found *= -1.0 if furthest[1] > 0 and angle else 1.0  # up the board
    most, rate = (clip.gravity * f(math.radians(angle)) for f in (math.sin, math.cos))
    known = math.hypot(sd, rate * math.radians(math.hypot(LEVEL_SD_DEG, clip.ramp_angle_sd_deg)))
    if found - most < SURE_SDS * known:
        return None
    speeds_up = f"{clip.path}: {observation.names[0]} speeds up by {found:.3g} +- {sd:.1g} m/s^2"
    if not angle:
        return (
            f"{speeds_up} on the level, where friction only slows it down: something pulls or "
            "pushes it, or the table slopes (scenario: incline)"
        )
    return (
        f"{speeds_up}; a slope of {angle:g} degrees gives {most:.3g} without any friction: check "
        "ramp_angle_deg, the times and the scale, or something pulls it"
    )


def apparent_gravity(clip: Clip, observation: Observation) -> ApparentGravity | None:
    """What gravity would be by the first object's path; None where it does not tell."""
    scenario = SCENARIOS[clip.scenario]
    if not clip.is_scale_known:
        return None
    path = observation.path()
    times, (x, y) = path.times_s, path.place_m[:2]
    if scenario.up_shows == "bend":
        return _of_free_body(times, y)
    if times.size < MIN_POINTS:
        return None
    if scenario.up_shows == "sag":
        arc = circle(x, y)
        known = clip.thread_m or (arc.radius if arc.is_told else None)
        return None if known is None else _of_pendulum(known, times, x)
    if scenario.is_level or scenario.angle_deg == 0:
        along = np.hypot(*np.array([x - x[0], y - y[0]]))
        slowing = _largest(accelerations(times, -along))  # of friction of 1, hardly of more
        return None if slowing is None else ApparentGravity(slowing, is_least=True)
    if not scenario.has_ramp or not clip.ramp_angle_deg:
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


def _of_free_body(times: np.ndarray, height: np.ndarray) -> ApparentGravity | None:
    """By one parabola where nothing more than scatter is left of it, else by those of windows."""
    windows, size, found = accelerations(times, -height), len(times) - 5, None
    if (value := _largest(windows)) is not None:
        scatter = 1.4826 * float(np.median(np.abs(windows - value)))
        found = ApparentGravity(value, sd=scatter / math.sqrt(len(windows) / 2))
        after = windows[int(np.argmax(windows)) :]
        if after[0] > LEVELS_OFF * after[-1] and after.min() > -after[0] / LEVELS_OFF:
            # The air stops it falling ever faster.
            found = ApparentGravity(float(after[0]), is_least=True)
    if size < 1 or np.ptp(height) == 0:
        return found
    parabola, more = (polynomial(times - times.mean(), height, degree) for degree in (2, 4))
    left, left_of_more = (float(np.sum(fit.left**2)) for fit in (parabola, more))
    gain = (left - left_of_more) / 2 / max(left_of_more / size, np.finfo(float).tiny)
    # Of Fisher's F with 2 and `size` degrees of freedom: P(F > x) = (1 + 2 x / size)^(-size / 2).
    if gain > size / 2 * (CHANCE ** (-2 / size) - 1):
        return found
    gravity, sd = -2 * float(parabola.solution[0]), 2 * float(parabola.sds[0])
    return ApparentGravity(gravity, sd=sd, is_parabola=True)


def thread_doubt(clip: Clip, observation: Observation) -> str | None:
    """One line where a bob's path is an arc of another radius than the thread that is declared."""
    if clip.thread_m is None or not clip.is_scale_known:
        return None
    path, name = observation.path(), observation.names[0]
    arc = circle(*path.place_m[:2])
    off = abs(arc.radius - clip.thread_m)
    is_sure = arc.is_told and off > SURE_SDS * arc.radius_sd
    if not is_sure or off < THREAD_OFF * max(arc.radius, clip.thread_m):
        return None
    swing_s = period_s(path.times_s, path.place_m[0])
    by_period = clip.gravity * (swing_s / (2 * math.pi)) ** 2
    return (
        f"{clip.path}: thread_m: {clip.thread_m:g}, but {name}'s path is an arc of radius "
        f"{arc.radius:.3g} +- {arc.radius_sd:.1g} m, and its period that of {by_period:.3g} m: "
        "check thread_m, the scale and what was followed"
    )


def _of_pendulum(thread_m: float, times: np.ndarray, x: np.ndarray) -> ApparentGravity | None:
    """From its period; None of less than a period, or of a swing that is no sine."""
    period = period_s(times, x)
    fit = sine_through(times, x, period)
    if np.ptp(times) < period or np.std(fit.left) > SINE * np.std(x):
        return None
    amplitude = min(float(np.hypot(*fit.solution[1:])) / thread_m, 1.0)
    longer = 1 + amplitude**2 / 16  # is the period than that of a narrow swing
    return ApparentGravity(thread_m * (2 * math.pi * longer / period) ** 2)


def _likely_unit(clip: Clip, found: ApparentGravity) -> tuple[str, float] | None:
    """The unit of length in which a track's gravity is the true one, and how far off it is then.

    The logarithm of the ratio; infinite of pixels, of which any scale is right. None: no unit.
    """
    if clip.track is None or clip.track_units == "px" or clip.thread_m is not None:
        return None
    value, key = found.value, "its columns in" if clip.is_own_track else "track_units:"
    declared = METRES_PER_UNIT[clip.track_units or "m"]
    shares = {
        unit: value * metres / declared / clip.gravity for unit, metres in METRES_PER_UNIT.items()
    }
    if found.is_least:
        would_do = [unit for unit, share in shares.items() if LEAST_SHARE < share < LEAST_FACTOR]
        return (f"{key} {' | '.join(would_do)}", math.inf) if would_do else None
    pixels = f"{key} px with {value / clip.gravity:.4g} pixels per metre"
    are_pixels = value > PIXELS_FROM * clip.gravity
    best = min(shares, key=lambda unit: abs(math.log(shares[unit])))
    off = abs(math.log(shares[best]))
    if off > max(UNIT_WITHIN, 2 * found.sd / value):
        return (pixels, math.inf) if are_pixels else None
    words = f"{key} {best}, with which it would be {shares[best] * clip.gravity:.3g} m/s^2"
    return f"{words}, or {pixels}" if are_pixels else words, off


def _likely(clip: Clip, factor: float, found: ApparentGravity) -> str:
    """The rate that is meant: the container's or a common one, where one is near.

    `factor`: of the true rate over the declared one.
    """

    def distance(fps: float) -> float:
        return abs(math.log(fps / (factor * clip.fps)))

    # Friction makes the ramp's acceleration, and with it the true rate, smaller than that.
    near = math.log(NEAR_FREE if found.is_parabola else NEAR * 2 if found.is_least else NEAR)
    if clip.container_fps and distance(clip.container_fps) < near:
        return f"likely fps: {clip.container_fps:.4g}, as the container says"
    best = min(COMMON_FPS, key=distance)
    if found.is_least:
        return f"likely fps: {best:g} or less"
    if distance(best) < near:
        return f"likely fps: {best:g}"
    return (
        f"no usual rate explains that, lengths {factor**2:.3g} times as long would: check the unit "
        "of length, the axes, what was followed, and `gravity` if it is another"
    )


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
    hit = None if len(observation.names) < 2 else observation.first_away(1)
    hit_s = math.inf if hit is None else float(times[max(hit - 1, 0)])
    for stretch in (on_table & (times < hit_s), on_table & (times > hit_s)):
        chosen = np.flatnonzero(stretch)
        speed = np.gradient(x[chosen], times[chosen]) if chosen.size > 1 else np.zeros(0)
        if speed.size and speed.max() > 0:
            # What has come to rest slows down no more.
            chosen = chosen[speed > 0.1 * speed.max()]
        if chosen.size < MIN_POINTS or np.ptp(x[chosen]) < LEAST_WAY_M:
            continue
        return max(0.0, -2 * float(np.polyfit(times[chosen] - times[chosen[0]], x[chosen], 2)[0]))
    return None
