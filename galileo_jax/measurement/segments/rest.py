"""Rests: between which of them the run is that is meant, and after which nothing moves any more."""

from collections.abc import Sequence
from itertools import combinations

import numpy as np

from galileo_jax.numerics.runs import stretches
from galileo_jax.observation.observation import Observation, PointPath

STILL_S, FEWEST = 0.3, 9
STILL, CLEAR = 1e-3, 5.0
REST_S = 0.25  # at rest for the last so long; that a motion ends belongs to it for as long
NEAR_END = 0.05  # of a radius: whoever stays so near to where it ends is at rest
ENOUGH = 3  # places that tell a speed
STILL_SD = 6.0  # of the errors: what is farther from where it ends has not ended
SOON_S, GOES_ON = 0.1, 0.05  # how far ahead it would have gone so much of its whole way
CARRIED = 0.02  # of the way: who was no further away was not carried


def placed_frames(observation: Observation) -> tuple[int | None, int | None]:
    """The first frame and the last in which object 1 is left to itself; None: the clip's own.

    A hand may first put the object into place, or take it away later. What rests on a board stays
    there. So between two rests there is one motion, and whoever made it, the run is the one that
    comes down furthest. Before the rest from which it begins the object was carried, and after the
    rest in which it ends it is carried again. Either frame is in the middle of a rest.
    """
    path = observation.path()
    place_m = path.place_m
    rests = rests_of(path)
    if not rests:
        return None, None
    runs = runs_between(rests, len(path))
    lowest = [first + int(np.argmin(place_m[1, first : last + 1])) for first, last in runs]
    firsts = [first for first, _ in runs]
    ways = (place_m[:, lowest] - place_m[:, firsts]).T
    run = int(np.argmin(ways[:, 1]))
    if ways[run, 1] >= 0:
        return None, None

    def carried(part: slice, rest: slice) -> int | None:
        """The middle of a rest beside which a part of the track was carried about."""
        home = np.median(place_m[:, rest], axis=1, keepdims=True)
        away = np.hypot(*(place_m[:, part] - home)).max(initial=0.0)
        middle = int(path.frames[(rest.start + rest.stop) // 2])
        return middle if away > CARRIED * np.hypot(*ways[run]) else None

    before, after = rests[run - 1] if run else None, rests[run] if run < len(rests) else None
    return (
        None if before is None else carried(slice(before.start), before),
        None if after is None else carried(slice(after.stop, None), after),
    )


def rests_of(path: PointPath) -> list[slice]:
    """Where along a path, by numbers of its places, it is at rest."""
    return stretches(_is_still(path)) if len(path) >= 2 * FEWEST else []


def runs_between(rests: Sequence[slice], count: int) -> list[tuple[int, int]]:
    """First and last place of each run between rests, before the first and after the last."""
    ends = [0, *(edge for rest in rests for edge in (rest.start, rest.stop - 1)), count - 1]
    return list(zip(ends[::2], ends[1::2], strict=True))


def is_one_place(held: PointPath, way_m: float) -> bool:
    """Whether a part of a path is a rest, as `_is_still` tells one, beside the whole way."""
    third = len(held) // 3
    most = _most_apart(way_m, held, third)
    means = [held.place_m[:, k * third : (k + 1) * third].mean(axis=1) for k in range(3)]
    return all(float(np.linalg.norm(a - b)) < most for a, b in combinations(means, 2))


def _most_apart(way_m: float, path: PointPath, third: int) -> float:
    """How far from each other the mean places of the thirds of a rest may be, m."""
    noise_m = CLEAR * np.sqrt(2 * float(np.median(path.variance_m2)) / third)
    return max(STILL * way_m, noise_m)


def _is_still(path: PointPath) -> np.ndarray:
    """Which of the places lie in a window at rest, `[place]`.

    A window of STILL_S is a rest if the mean places of its thirds agree within STILL of the whole
    way, or within CLEAR standard deviations of such a mean: what turns back is further away at
    either end.
    """
    place, size = path.place_m, round(STILL_S / float(np.median(np.diff(path.times_s))))
    third = max(FEWEST, size) // 3
    covered = np.zeros(len(path), bool)
    if len(path) < max(FEWEST, size):
        return covered
    extent = float(np.hypot(*np.ptp(place, axis=1)))
    most = _most_apart(extent, path, third)
    means = np.lib.stride_tricks.sliding_window_view(place, third, axis=1).mean(axis=-1)
    count = len(path) - 3 * third + 1
    parts = [means[:, k * third : k * third + count] for k in range(3)]
    apart = [np.hypot(*(parts[i] - parts[j])) for i, j in ((0, 1), (1, 2), (0, 2))]
    for first in np.flatnonzero(np.max(apart, axis=0) < most):
        covered[first : first + 3 * third] = True
    return covered


def rest_frame(observation: Observation, radius_m: float) -> int | None:
    """The last frame worth a look; None where something moves to the end, or almost so.

    After all has come to rest a film shows only how its camera drifts. `radius_m` is that of the
    smallest object.
    """
    last = []
    for path in filter(len, map(observation.path, range(len(observation.names)))):
        end = path.place_m[:2, -max(len(path) // 8, 1) :].mean(axis=1, keepdims=True)
        away = np.linalg.norm(path.place_m[:2] - end, axis=0) > NEAR_END * radius_m
        last.append(path.frames[np.flatnonzero(away)[-1]] if away.any() else path.frames[0])
    if not last:
        return None
    times = observation.times_s
    end = int(np.searchsorted(times, times[max(last)] + REST_S))
    return end if observation.mask[:, end + 1 :].any() else None


def standstill_frame(observation: Observation) -> int | None:
    """The last frame before something stops it for good; None where it comes to rest by itself.

    It is at rest for the last quarter of a second or longer, and would have gone on for a twentieth
    of its whole way within a tenth of a second.
    """
    path = observation.path()
    times, place = path.times_s, path.place_m
    ended = times > times[-1] - REST_S if len(path) else np.zeros(0, bool)
    if ended.sum() < 2 * ENOUGH or ended.all():
        return None
    still = STILL_SD * float(np.sqrt(np.median(2 * path.variance_m2)))
    away = np.linalg.norm(place - np.median(place[:, ended], axis=1, keepdims=True), axis=0) > still
    if (away & ended).any() or not away.any():
        return None
    last = int(np.flatnonzero(away)[-1])
    before = min(max(last - ENOUGH, 0), int(np.searchsorted(times, times[last] - SOON_S / 2)))
    if last == before:
        return None
    speed = np.linalg.norm(place[:, last] - place[:, before]) / (times[last] - times[before])
    width = float(np.linalg.norm(np.ptp(place, axis=1)))
    return int(path.frames[last - 1]) if speed * SOON_S > max(GOES_ON * width, still) else None
