"""What nobody measured of a ramp, from the paths of the objects on it: slope, foot and sizes.

    slope         direction of the path = principal axis of the points seen on the ramp
    foot          the lines of the path before and after it meet at
                  foot + (h tan(a/2), h),   a the angle between them
    half height   of a centre above the table, or above the ramp: h
    half lengths  their sum is the distance of the centres when objects hit

A point fixed to a sliding object stays at one distance from the surface, so its path is parallel
to the ramp whatever point it is. The picture's vertical is taken for gravity's. Sizes enter the
model of a ramp that ends on a table only.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from galileo_jax.clip.fields import MAX_ANGLE_SD_DEG, MAX_SIZE_M, MIN_RAMP_ANGLE_DEG, MIN_SIZE_M
from galileo_jax.clip.scenarios import SCENARIOS
from galileo_jax.clip.schema import Clip, ClipObject
from galileo_jax.clip.sizes import extents
from galileo_jax.numerics.least_squares import Line, line_through, polynomial, two_lines
from galileo_jax.observation.observation import Observation
from galileo_jax.runtime.errors import InputError

LEVEL_SD_DEG = 0.5  # how level a camera stands on a tripod, and how straight a lens draws
MAX_SCATTER_SD_DEG = 2.0  # a path that tells its slope no better does not tell it
UPPER_SHARE = 0.75  # of the way down; further down the object's front is on the table already
MIN_POINTS = 5  # on a line, or on either side of a bend
SHARP = 1 / 3  # of what a parabola leaves: two lines leave less where a path bends at one place
MOST_POINTS = 500  # among which a bend is looked for
SEEN_DEG = 0.5  # a path that goes on so nearly in its direction goes on
OFF_SDS = 4.0  # of the errors: a place that is so far from a line is not on it
MIN_BEND_DEG = 4.0  # a path that bends by less shows no foot
BEGIN_SHARE, LEAST_BEND = 0.5, 0.01  # of a valley's way; by so many rad its slope changes there
SIZE_SD_M = 0.003  # a marked point is the centre, and a height right, no better
SAME_FOOT_SDS = 3.0  # of what a centre and a height are known to: an origin so near is the foot
NUM_BESIDE = 3  # frames on either side of a hit through which the distance's lines are laid


@dataclass(frozen=True)
class Slope:
    """The slope of a ramp, from the picture's horizontal, downhill positive, and its sd."""

    angle_deg: float
    sd_deg: float


def infer_slope(clip: Clip, observation: Observation) -> Slope:
    """The slope of the way that the first object takes down the ramp, or up.

    Raises:
      InputError: it hardly moves on the ramp, against the declared direction, or on the level.
    """
    name = observation.names[0]
    points = observation.path().place_m
    has_foot = SCENARIOS[clip.scenario].has_table and points.size > 0
    if has_foot:
        points = points[:, points[0] < (1 - UPPER_SHARE) * min(points[0, 0], 0.0)]

    def refused(why: str) -> InputError:
        return InputError(
            f"{clip.path}: ramp_angle_deg: null, and {name}{why}; "
            "give the angle in degrees, or `galileo label --ramp X1 Y1 X2 Y2`"
        )

    if points.shape[1] < MIN_POINTS:
        where = " left of origin_px, the ramp's foot" if has_foot else ""
        raise refused(
            f" is seen in {points.shape[1]} frames{where}; too few to determine the slope"
        )
    line = line_through(points)  # where a board is curved, what goes down may come back
    covariance = observation.covariance_m2[0][:, :, observation.mask[0]]
    noise_m = math.sqrt(float(np.median(np.trace(covariance))) / 2)
    scatter_m = max(math.sqrt(line.spread[0] / (points.shape[1] - 2)), noise_m)
    sd_deg = math.degrees(scatter_m / math.sqrt(max(line.spread[1], 1e-30)))
    if sd_deg > MAX_SCATTER_SD_DEG:
        unit = "m" if clip.is_scale_known else "of the picture's units"
        raise refused(
            f" moves by only {float(np.ptp(line.along @ points)):.3g} {unit} on the ramp, "
            "too little to determine the slope"
        )
    goes_back = line.along[0] < 0
    if goes_back:
        line = line._replace(along=-line.along)
    angle_deg = falls_deg(line)
    if goes_back and angle_deg < MIN_RAMP_ANGLE_DEG:
        if clip.is_own_track:
            raise InputError(
                f"{clip.path}: track: {name}'s x decreases; x along the travel expected; turn the "
                "sign of the csv's x columns"
            )
        other = "left" if clip.direction == "right" else "right"
        raise InputError(
            f"{clip.path}: direction: {clip.direction}, but {name} moves to the {other}; "
            f"write direction: {other}"
        )
    if angle_deg < MIN_RAMP_ANGLE_DEG:
        # A valley: what rolls down into it comes to rest as high as it began.
        angle_deg = max(angle_deg, _at_start_deg(points, line))
    if not MIN_RAMP_ANGLE_DEG <= angle_deg < 90:
        raise refused(f"'s path falls by {angle_deg:.1f} degrees: no ramp")
    sd_deg = min(math.hypot(sd_deg, LEVEL_SD_DEG), MAX_ANGLE_SD_DEG)
    return Slope(round(angle_deg, 3), round(sd_deg, 3))


def falls_deg(line: Line) -> float:
    """How steeply a line falls in the direction of the travel."""
    return math.degrees(math.atan2(-line.along[1], line.along[0]))


def _at_start_deg(points: np.ndarray, line: Line) -> float:
    """The slope of the first part of a way into a valley, of a parabola through it; else -90."""
    gone = points - points[:, :1]
    way = line.along @ gone
    first = (way < BEGIN_SHARE * way.max()) & (np.arange(len(way)) <= int(np.argmax(way)))
    if first.sum() < MIN_POINTS or np.ptp(way[first]) <= 0:
        return -90.0
    bend, slope, _ = np.polyfit(gone[0, first], gone[1, first], 2)
    is_valley = bend * np.ptp(gone[0, first]) > LEAST_BEND
    return math.degrees(math.atan(-slope)) if is_valley else -90.0


def infer_foot(clip: Clip, observation: Observation) -> np.ndarray:
    """Where the ramp meets the table, `[2]`, m, in the observation's axes.

    An object without a size is taken to be as high as long: with another height all of the table is
    higher by as much, and moves alike.

    Args:
      clip: the clip.
      observation: of any origin.

    Raises:
      InputError: the path does not bend.
    """
    half_length, half_height = _first_extents(clip, observation)
    found = _bend(observation, half_length)
    if found is None:
        raise InputError(
            f"{clip.path}: origin_px: null, and {clip.objects[0].name}'s path does not bend: the "
            "foot of the ramp is not declared; set it with `galileo label --origin X Y`"
        )
    bend, half_angle = found
    return bend - half_height * np.array([math.tan(half_angle), 1.0])


def foot_of_table(clip: Clip, observation: Observation) -> np.ndarray | None:
    """Where the foot is in a table, `[2]`, m; None where it is the origin, or does not show.

    Whoever measured chose the origin. It may be the foot where the path bends at (h tan(a/2), h),
    h that of the first object, or any where that is unknown. Else as `infer_foot`.
    """
    half_length, half_height = _first_extents(clip, observation)
    found = _bend(observation, half_length)
    if found is None:
        return None
    bend, half_angle = found
    shift = np.array([math.tan(half_angle), 1.0])
    is_known = clip.objects[0].size_m is not None
    height = half_height if is_known else float(np.clip(bend[1], 0.0, MAX_SIZE_M / 2))
    if np.linalg.norm(bend - height * shift) < SAME_FOOT_SDS * SIZE_SD_M:
        return None
    return bend - half_height * shift


def _first_extents(clip: Clip, observation: Observation) -> tuple[float, float]:
    """Half the first object's length along the travel and half its height, m."""
    if (first := clip.objects[0]).size_m is not None:
        return extents(first)
    apart = distance_at_hit(observation, 0) if len(clip.objects) > 1 else None
    half = max(apart or 0.0, MIN_SIZE_M) / 2
    return half, half


def _bend(observation: Observation, half_length_m: float) -> tuple[np.ndarray, float] | None:
    """Where the lines of the first path before and after the foot meet, m, and half their angle.

    None where it does not bend, as where it does not reach the table.
    """
    points = observation.path().place_m
    best = two_lines(points, MIN_POINTS)
    if best is None or not falls_deg(best[0]) - falls_deg(best[1]) >= MIN_BEND_DEG:
        return None
    before, after, at = best
    # While the object turns its centre leaves both lines: those points are left out.
    bend = _meeting(before, after)
    is_far = np.linalg.norm(points - bend[:, None], axis=0) > 1.5 * half_length_m
    parts = points[:, :at][:, is_far[:at]], points[:, at:][:, is_far[at:]]
    if min(part.shape[1] for part in parts) >= MIN_POINTS:
        before, after = map(line_through, parts)
        bend = _meeting(before, after)
    return bend, math.radians(falls_deg(before) - falls_deg(after)) / 2


def _meeting(before: Line, after: Line) -> np.ndarray:
    """Where two lines cross, `[2]`."""
    both = np.stack([before.along, -after.along], axis=1)
    return before.middle + np.linalg.solve(both, after.middle - before.middle)[0] * before.along


def end_of_slope(observation: Observation) -> int | None:
    """The last frame before the slope of the first path ends in another; None where it goes on.

    Two straight lines that differ by `SEEN_DEG`, and clearly, and leave a third of what a parabola
    does: a path that bends all along has no such end, nor what rests before it goes.
    """
    path = observation.path()
    path = path[:: -(-len(path) // MOST_POINTS) or 1]
    points, frames = path.place_m[:2], path.frames
    lasting = np.sum(observation.lasting_m[:, 0][..., frames] ** 2, axis=(0, 1)) / 2
    variance = path.variance_m2 + lasting
    best = two_lines(points, 2 * MIN_POINTS)
    if best is None:
        return None
    # What turns over an edge leaves both lines: each is told by what is far from it.
    at = best[2]
    sides = slice(at - at // 4), slice(at + (len(frames) - at) // 4, None)
    lines = [line_through(points[:, side]) for side in sides]
    off_m, known_deg = [], []
    for line, side in zip(lines, sides, strict=True):
        own = variance[side]
        off_m.append(math.sqrt(max(line.spread[0] / len(own), float(np.median(own)))))
        known_deg.append(math.degrees(off_m[-1] / math.sqrt(max(line.spread[1], 1e-30))))
    bend_deg = abs(falls_deg(lines[0]) - falls_deg(lines[1]))
    whole = line_through(points)
    along, across = np.stack([whole.along, whole.across]) @ (points - whole.middle[:, None])
    bent_m = math.sqrt(float(np.mean(polynomial(along, across, 2).left ** 2)))
    if bend_deg < max(SEEN_DEG, OFF_SDS * math.hypot(*known_deg)) or max(off_m) > SHARP * bent_m:
        return None
    on = np.abs(lines[0].across @ (points - lines[0].middle[:, None])) < OFF_SDS * off_m[0]
    on[sides[0]] = True
    return None if on[-1] else int(frames[np.flatnonzero(on)[-1]])


def infer_sizes(clip: Clip, observation: Observation) -> Mapping[str, tuple[float, ...]]:
    """`size_m` by name of the objects that have none; what is tracked is their centres.

    Raises:
      InputError: two that hit each other are nearer then than their sizes allow.
    """
    angle = math.radians(clip.ramp_angle_deg or 0.0)
    halves = [extents(item) if item.size_m else (None, None) for item in clip.objects]
    lengths = [half[0] for half in halves]
    for k in range(len(lengths) - 1):
        apart, pair = distance_at_hit(observation, k), lengths[k : k + 2]
        if apart is not None and None in pair:
            known = sum(length for length in pair if length is not None)
            share = (apart - known) / pair.count(None)
            if share < MIN_SIZE_M / 2:
                both = [item.name for item in clip.objects[k : k + 2]]
                raise InputError(
                    f"{clip.path}: objects: size_m: null of {' or '.join(both)}, and their paths "
                    f"do not show it: at the hit they are {apart:.3g} m apart; write size_m, name "
                    "first what comes down the ramp, and see whether both are followed: "
                    f"galileo track {clip.source or clip.path}"
                )
            lengths[k : k + 2] = [share if length is None else length for length in pair]
    heights = [
        _height(observation, k, angle) if half[1] is None else half[1]
        for k, half in enumerate(halves)
    ]
    return {
        item.name: _size(item, length or height, height)
        for item, length, height in zip(clip.objects, lengths, heights, strict=True)
        if item.size_m is None
    }


def _height(observation: Observation, k: int, angle: float) -> float:
    """Of the centre above the surface, m."""
    x, y = observation.path(k).place_m
    if not x.size:
        return MIN_SIZE_M  # never seen: building the scene refuses it
    above_ramp = y * math.cos(angle) + x * math.sin(angle)
    height = float(np.median(y[x > 0] if (x > 0).any() else above_ramp))
    return float(np.clip(height, MIN_SIZE_M / 2, MAX_SIZE_M / 2))


def distance_at_hit(observation: Observation, k: int) -> float | None:
    """Between the centres of objects k and k + 1 when the one hits the other, m; None if never."""
    both = observation.mask[k] & observation.mask[k + 1]
    first, second = observation.position_m[k, 0, both], observation.position_m[k + 1, 0, both]
    if both.sum() < 2 * NUM_BESIDE + 1:
        return None
    away = observation.first_away(k + 1)
    if away is None:
        return None
    apart, times = second - first, observation.times_s[both]
    at = int(np.searchsorted(np.flatnonzero(both), away))
    before, after = slice(max(at - 1 - NUM_BESIDE, 0), max(at - 1, 0)), slice(at, at + NUM_BESIDE)
    if min(len(apart[before]), len(apart[after])) < 2:
        return float(apart.min())
    down, up = (np.polyfit(times[part], apart[part], 1) for part in (before, after))
    if down[0] >= up[0] - 1e-9:
        return float(apart.min())
    return float(np.polyval(up, (up[1] - down[1]) / (down[0] - up[0])))


def _size(item: ClipObject, half_length: float, half_height: float) -> tuple[float, ...]:
    """The size of its shape with these extents, as `extents` reads it; a box is as deep as long."""
    match item.shape:
        case "box":
            size = (2 * half_length, 2 * half_length, 2 * half_height)
        case "cylinder":
            size = (half_length, 2 * half_height)
        case "torus":
            size = (max(half_length - half_height, 1.01 * half_height), half_height)
        case _:
            size = (half_height,)
    return tuple(round(float(np.clip(value, MIN_SIZE_M, MAX_SIZE_M)), 4) for value in size)
