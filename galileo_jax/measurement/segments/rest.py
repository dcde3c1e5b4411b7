"""Rests: between which of them the run is that is meant, and after which nothing moves any more."""

import numpy as np

from galileo_jax.observation.observation import Observation, PointPath, stretches

STILL_S, FEWEST = 0.3, 9
STILL, CLEAR = 1e-3, 5.0
REST_S = 0.25
"""At rest for the last so long; that a motion ends belongs to it for as long."""
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

    A window of STILL_S is a rest if the mean places of its thirds agree within STILL of the whole
    way, or within CLEAR standard deviations of such a mean: what turns back is further away at
    either end.
    """
    path = observation.path()
    place_m = path.place_m
    if len(path) < 2 * FEWEST:
        return None, None
    size = max(FEWEST, round(STILL_S / float(np.median(np.diff(path.times_s)))))
    if len(path) < size:
        return None, None
    rests = stretches(_is_still(path, size))
    if not rests:
        return None, None
    # Between rests, and before the first and after the last of them.
    ends = [0, *(edge for rest in rests for edge in (rest.start, rest.stop - 1)), len(path) - 1]
    runs = list(zip(ends[::2], ends[1::2], strict=True))
    falls = [place_m[1, first] - place_m[1, last] for first, last in runs]
    run = int(np.argmax(falls))
    way = float(np.hypot(*(place_m[:, runs[run][1]] - place_m[:, runs[run][0]])))
    if falls[run] <= 0:
        return None, None

    def is_carried(part: slice, rest: slice) -> bool:
        home = np.median(place_m[:, rest], axis=1, keepdims=True)
        away = np.hypot(*(place_m[:, part] - home))
        return bool(away.size and away.max() > CARRIED * way)

    first = last = None
    if run > 0 and is_carried(slice(None, rests[run - 1].start), rests[run - 1]):
        first = int(path.frames[_middle(rests[run - 1])])
    if run < len(rests) and is_carried(slice(rests[run].stop, None), rests[run]):
        last = int(path.frames[_middle(rests[run])])
    return first, last


def _is_still(path: PointPath, size: int) -> np.ndarray:
    """Which of the places lie in a window at rest, `[place]`."""
    place, third = path.place_m, size // 3
    variance = float(np.median(path.variance_m2))
    extent = float(np.hypot(*np.ptp(place, axis=1)))
    most = max(STILL * extent, CLEAR * np.sqrt(2 * variance / third))
    means = np.lib.stride_tricks.sliding_window_view(place, third, axis=1).mean(axis=-1)
    count = place.shape[1] - 3 * third + 1
    parts = [means[:, k * third : k * third + count] for k in range(3)]
    apart = [np.hypot(*(parts[i] - parts[j])) for i, j in ((0, 1), (1, 2), (0, 2))]
    still = np.max(apart, axis=0) < most
    covered = np.zeros(len(path), bool)
    for shift in range(3 * third):
        covered[shift : shift + count] |= still
    return covered


def _middle(rest: slice) -> int:
    return (rest.start + rest.stop) // 2


def rest_frame(observation: Observation, radius_m: float) -> int | None:
    """The last frame worth a look; None where something moves to the end, or almost so.

    After all has come to rest a film shows only how its camera drifts.

    Args:
      observation: of all objects, `[object, axis, frame]`; x and y count.
      radius_m: of the smallest object.
    """
    last = []
    for path in map(observation.path, range(len(observation.names))):
        if not len(path):
            continue
        end = path.place_m[:2, -max(len(path) // 8, 1) :].mean(axis=1, keepdims=True)
        away = np.linalg.norm(path.place_m[:2] - end, axis=0) > NEAR_END * radius_m
        last.append(path.frames[np.flatnonzero(away)[-1]] if away.any() else path.frames[0])
    if not last:
        return None
    times = observation.times_s
    end = int(np.searchsorted(times, times[max(last)] + REST_S))
    seen = np.flatnonzero(observation.mask.any(axis=0))
    return end if end < seen[-1] else None


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
    way = float(np.linalg.norm(place[:, last] - place[:, before]))
    speed = way / (times[last] - times[before])
    width = float(np.linalg.norm(np.ptp(place, axis=1)))
    goes_on = speed * SOON_S > max(GOES_ON * width, still)
    return int(path.frames[last - 1]) if goes_on else None
