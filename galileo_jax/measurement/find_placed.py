"""The run that is meant, where a hand first puts the object into place, or takes it away later.

What rests on a board stays there. So between two rests there is one motion, and whoever made it,
the run is the one that comes down furthest. Before the rest from which it begins the object was
carried, and after the rest in which it ends it is carried again.

A window of REST_S is a rest if the mean places of its thirds agree within STILL of the whole way,
or within CLEAR standard deviations of such a mean: what turns back is further away at either end.
"""

import numpy as np

from galileo_jax.observation.observation import Observation

REST_S, FEWEST = 0.3, 9
STILL, CLEAR = 1e-3, 5.0
CARRIED = 0.02  # of the way: who was no further away was not carried


def placed_frames(observation: Observation) -> tuple[int | None, int | None]:
    """The first frame and the last in which object 1 is left to itself; None: the clip's own.

    Either is in the middle of a rest.
    """
    seen = np.flatnonzero(observation.mask[0])
    times_s, place_m = observation.times_s[seen], observation.position_m[0][:, seen]
    if len(seen) < 2 * FEWEST:
        return None, None
    size = max(FEWEST, round(REST_S / float(np.median(np.diff(times_s)))))
    if len(seen) < size:
        return None, None
    rests = _stretches(_is_still(observation, seen, size))
    if not rests:
        return None, None
    # Between rests, and before the first and after the last of them.
    ends = [0, *(edge for rest in rests for edge in (rest.start, rest.stop - 1)), len(seen) - 1]
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
        first = int(seen[_middle(rests[run - 1])])
    if run < len(rests) and is_carried(slice(rests[run].stop, None), rests[run]):
        last = int(seen[_middle(rests[run])])
    return first, last


def _is_still(observation: Observation, seen: np.ndarray, size: int) -> np.ndarray:
    """Which of the frames seen lie in a window at rest, `[frame]`."""
    place = observation.position_m[0][:, seen]
    third = size // 3
    variance = float(np.median(observation.variance_m2[0, seen]))
    extent = float(np.hypot(*np.ptp(place, axis=1)))
    most = max(STILL * extent, CLEAR * np.sqrt(2 * variance / third))
    means = np.lib.stride_tricks.sliding_window_view(place, third, axis=1).mean(axis=-1)
    count = place.shape[1] - 3 * third + 1
    parts = [means[:, k * third : k * third + count] for k in range(3)]
    apart = [np.hypot(*(parts[i] - parts[j])) for i, j in ((0, 1), (1, 2), (0, 2))]
    still = np.max(apart, axis=0) < most
    covered = np.zeros(len(seen), bool)
    for shift in range(3 * third):
        covered[shift : shift + count] |= still
    return covered


def _stretches(is_there: np.ndarray) -> list[slice]:
    steps = np.diff(np.concatenate([[0], is_there.astype(int), [0]]))
    ends = zip(np.flatnonzero(steps > 0), np.flatnonzero(steps < 0), strict=True)
    return [slice(int(first), int(after)) for first, after in ends]


def _middle(rest: slice) -> int:
    return (rest.start + rest.stop) // 2
