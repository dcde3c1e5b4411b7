"""Does an object go the way that is declared? Down the board, along the table, or straight down.

The direction of a straight path is the principal axis of its points. A camera stands level within
half a degree; a path that leaves the declared way by more than `CLEAR` standard deviations is said.
By more than `TURNED_DEG`, or where the path lies along an axis of a table, no angle was read off
wrongly: the axes are turned (lengths along the board as x, a camera on its side). The way along the
path is then the way along the declared line.
"""

import math
from dataclasses import dataclass, replace

import numpy as np

from galileo_jax.clip.fields import MIN_RAMP_ANGLE_DEG
from galileo_jax.clip.look import likely_in_plane
from galileo_jax.clip.scenarios import SCENARIOS
from galileo_jax.clip.schema import Clip
from galileo_jax.clip.track_axes import line_observation, sign_along
from galileo_jax.measurement.infer_ramp import LEVEL_SD_DEG, MIN_POINTS, falls_deg
from galileo_jax.numerics.least_squares import circle, line_through, polynomial
from galileo_jax.observation.observation import Observation, PointPath

CLEAR = 4.0
TURNED_DEG = 6.0
NEARER = 3.0  # by so many times an axis of a table must be nearer to the path than the declared way
STRAIGHT = 0.02  # of its length: a path that bends by more has no direction but an axis's
MOST_SD_DEG = 1.0
EVENLY = 0.8  # of its first acceleration: what a spring pulls back loses all of it in a quarter
EVEN = 0.2  # of its mean, by which the rate of a turn scatters that is even


@dataclass(frozen=True)
class OtherWay:
    """A path that does not go where it is declared to go."""

    declared_deg: float  # below the horizontal, along the travel
    # the path's, as it was measured
    path_deg: float
    sd_deg: float
    is_turned_back: bool  # whether the way along the path is taken for the declared way


def other_way(clip: Clip, observation: Observation) -> OtherWay | None:
    """What the path of object 1 says against the declared way; None where they agree.

    The axes of a table may be turned. A spring works along any line: its load's weight shifts the
    place of rest alone.
    """
    scenario = SCENARIOS[clip.scenario]
    declared = clip.ramp_angle_deg if scenario.has_ramp else 90.0
    is_line = not (scenario.moves_in_plane or scenario.is_level or scenario.has_table)
    seen = observation.path()
    points = seen.place_m
    if not is_line or declared is None or len(points) != 2 or len(seen) < MIN_POINTS:
        return None
    line = line_through(points)
    away = points - line.middle[:, None]
    if not (length := float(np.ptp(line.along @ away))):
        return None
    scatter = max(line.spread[0] / (len(seen) - 2), float(np.median(seen.variance_m2)))
    sd = math.degrees(math.sqrt(scatter / line.spread[1]))
    path = falls_deg(line)
    is_spring = "spring" in scenario.laws
    may_turn = is_spring or not observation.is_tracked_here
    # What goes to and fro has no end; boards and liquids may be gone up as well as down.
    is_both_ways = is_spring or scenario.has_ramp or scenario.up_shows == "sink"
    apart = abs(_turn_between(path, declared, 180.0 if is_both_ways else 360.0))
    if is_spring or (scenario.has_ramp and not may_turn):
        path = _turn_between(path, 0.0, 180.0)
    off_axis = min(abs(path) % 90.0, 90.0 - abs(path) % 90.0)
    is_thrown = scenario.up_shows == "bend" and likely_in_plane(*points).is_throw
    if may_turn and not is_thrown and apart > NEARER * max(off_axis, sd):
        return OtherWay(declared, path, sd, True)
    known = math.hypot(sd, LEVEL_SD_DEG, clip.ramp_angle_sd_deg)
    is_straight = np.abs(line.across @ away).max() <= STRAIGHT * length
    if sd > MOST_SD_DEG or not is_straight or apart < CLEAR * known:
        return None
    return OtherWay(declared, path, sd, may_turn and apart > TURNED_DEG)


def rises_forward(clip: Clip, observation: Observation) -> bool:
    """Whether object 1 goes straight up along `direction`: the board falls the other way.

    By as much as it is declared to fall, where that is declared. A table of metres has no
    `direction`.
    """
    points = observation.path().place_m
    if clip.is_own_track or points.shape[1] < MIN_POINTS:
        return False
    line = line_through(points)
    away = points - line.middle[:, None]
    if np.abs(line.across @ away).max() > STRAIGHT * np.ptp(line.along @ away):
        return False
    rises = -_turn_between(falls_deg(line), 0.0, 180.0)
    declared = clip.ramp_angle_deg
    return rises >= MIN_RAMP_ANGLE_DEG and (declared is None or abs(rises - declared) < TURNED_DEG)


def _never_slower(clip: Clip, path: PointPath) -> str | None:
    """One line where what should swing on a spring speeds up evenly to its end; else None."""
    if len(path) < MIN_POINTS or path.farthest < len(path) - 1:
        return None
    way = np.linalg.norm(path.gone_m, axis=0)
    since = path.times_s - path.times_s[0]
    cubic, square, *_ = polynomial(since, way, 3).solution
    if not square > 0 or 2 * square + 6 * cubic * since[-1] < EVENLY * 2 * square:
        return None
    return (
        f"{clip.path}: {clip.objects[0].name} speeds up all the way and does not turn back, as "
        "nothing does that swings on a spring (perhaps scenario: incline, or fall)"
    )


def _goes_round(times_s: np.ndarray, place: np.ndarray) -> bool:
    """Whether a path `[2, frame]` is a whole circle that is passed through evenly."""
    round_it = circle(*place)
    if not round_it.is_told:
        return False
    x, y = place - np.array(round_it.centre)[:, None]
    angle = np.unwrap(np.arctan2(y, x))
    rate = np.gradient(angle, times_s)
    is_even = np.std(rate) < EVEN * abs(np.mean(rate))
    return bool(is_even and np.ptp(angle) > 2 * math.pi)


def _turn_between(one_deg: float, other_deg: float, period_deg: float) -> float:
    """The smallest turn from the second direction to the first, of those a period apart."""
    return (one_deg - other_deg + period_deg / 2) % period_deg - period_deg / 2


def turned_back(clip: Clip, observation: Observation, way: OtherWay) -> Observation:
    """The observation with the ways along object 1's path as ways along the declared line.

    What lies across the path says nothing of motion along a line, and counts as not measured.
    """
    angle = math.radians(way.path_deg)
    along = np.array([math.cos(angle), -math.sin(angle)])
    gone = np.einsum("a,oat->ot", along, observation.position_m)
    sd_m = np.sqrt(np.einsum("a,b,oabt->ot", along, along, observation.covariance_m2))
    sign = sign_along(clip, observation.times_s, gone[0])
    on_line = line_observation(clip, observation.names, observation.times_s, sign * gone, sd_m)
    return replace(observation, position_m=on_line.position_m, covariance_m2=on_line.covariance_m2)


def way_text(clip: Clip, way: OtherWay) -> str:
    """The two directions, and which is used, in a line without the clip's name."""
    falls = "falls" if way.path_deg >= 0 else "rises"
    scenario = SCENARIOS[clip.scenario]
    path = f"{falls} by {abs(way.path_deg):.1f} +- {way.sd_deg:.1g} degrees"
    if "spring" in scenario.laws:
        return f"{clip.objects[0].name} swings along a line that {path}, not straight down"
    declared = (
        f"ramp_angle_deg: {way.declared_deg:g} is declared"
        if scenario.is_sloped
        else f"{'level' if scenario.has_ramp else 'straight down'} is what scenario "
        f"{clip.scenario} says"
    )
    what_then = (
        "; the axes are taken to be turned, and the declared angle is used"
        if way.is_turned_back
        else ", which is used; check the angle, and whether the camera stood level"
    )
    return f"{clip.objects[0].name}'s path {path}, but {declared}{what_then}"


def path_doubt(clip: Clip, observation: Observation) -> str | None:
    """One line where an object goes straight on where its scenario does not; else None."""
    path, name = observation.path(), observation.names[0]
    if clip.scenario == "spring":
        return _never_slower(clip, path)
    if clip.scenario not in ("pendulum", "fall", "ramp") or not len(path):
        return None
    place = path.place_m[:2]
    if clip.scenario == "ramp":
        place = place[:, place[0] > 0]
        if place.shape[1] < MIN_POINTS:
            return None
    likely = likely_in_plane(*place)
    if clip.scenario == "ramp":
        slope_deg = likely.slope_deg or 0.0
        if likely.scenario != "incline" or slope_deg < TURNED_DEG:
            return None
        return (
            f"{clip.path}: {name} goes straight down by {slope_deg:.1f} degrees where the table is "
            "level (perhaps scenario: incline, or the origin is not the foot of the ramp)"
        )
    if clip.scenario == "fall":
        if likely.is_throw:
            return (
                f"{clip.path}: {name} goes along {likely.why}, and what falls goes straight down "
                "(perhaps scenario: flight)"
            )
        across, up = path.gone_m[:2, path.farthest]
        if abs(across) <= abs(up):  # no camera is turned by more
            return None
        return (
            f"{clip.path}: {name} goes across by {abs(across):.3g} m, farther than down, and "
            "what falls goes down: mark the thing that is meant (`--point X Y`), or turn the film "
            "if its camera lay on its side"
        )
    if _goes_round(path.times_s, place):
        return (
            f"{clip.path}: {name} goes round and round at an even speed; what hangs on a thread is "
            "slower above than below (is it seen from above, where nothing hangs?)"
        )
    if likely.scenario not in ("incline", "fall") or not likely.is_clear:
        return None
    return (
        f"{clip.path}: {name} goes {likely.why} and does not turn back; what hangs on a thread "
        f"goes along an arc (perhaps scenario: {likely.scenario})"
    )
