"""A blow: the velocity jumps, and nothing in the scene is there to hit.

Between the steps a and b around a frame, with d the time between their middles, it is a blow if
of the change of velocity c = v_b - v_a

    |c| > HIT_M_S2 times a step            (no friction, drag or weight accelerates so)
    |c| > SHARE of the speed before        (a bump on the way is none)
    |c| > CLEAR standard deviations of c
    |c| / d > USUAL times what the run's own accelerations are (three in four are smaller):
                                           lengths may be in units that nobody knows

where v_a and v_b are medians of the steps on either side, so that no single point makes a blow.
Medians are blind to a step or two. So when it was is told by two parabolas, one to the last frame
before the blow and one from the next on: that frame is taken with which they leave least, or the
latest that leaves hardly more, for a frame of the blow itself lies on both. As errors may be larger
in one direction than in another (along the way, where times are not known well), what they leave is
the determinant of its scatter. A blow that lasts takes further frames: those that do not lie where
the parabola of the frames before them goes on to.
"""

import numpy as np

from galileo_jax.observation.observation import Observation

HIT_M_S2 = 20.0  # two g
SHARE = 0.3
CLEAR = 6.0
USUAL = 4.0
GOES_ON = 0.1  # of the speed: what keeps less has been stopped
STEPS = 3  # on either side
SMEARED = 2  # steps into which the blow itself may fall
PARABOLA_FRAMES, FEWEST = 10, 4  # on either side of a blow
AS_WELL = 9.0  # in -2 log likelihood: three standard deviations
FLOOR = 0.01  # of the track's variance: a few points may leave nothing in some direction


def blow_frame(observation: Observation, index: int = 0, from_rest: bool = False) -> int | None:
    """The last frame before an object is struck; None where nothing strikes it.

    Args:
      observation: its x and y count, and z in space.
      index: of the object.
      from_rest: whether what is at rest may be struck; else it is let go.
    """
    seen = np.flatnonzero(observation.mask[index])
    axes = 2 if observation.is_turning else observation.position_m.shape[1]
    if len(seen) < 2 * STEPS + SMEARED + 2:
        return None
    times_s, place_m = observation.times_s[seen], observation.position_m[index][:axes, seen]
    step_s = np.diff(times_s)
    velocity = np.diff(place_m) / step_s
    variance = observation.variance_m2[index, seen]
    sd = np.sqrt(variance[1:] + variance[:-1]) / step_s
    middle_s = times_s[:-1] + step_s / 2
    windows = np.lib.stride_tricks.sliding_window_view(velocity, STEPS, axis=1)
    usual, error = np.median(windows, axis=-1), _median(sd) / np.sqrt(STEPS)
    centre_s = _median(middle_s)
    # From the middle of one window to that of the next which shares no step with it.
    apart = STEPS + SMEARED - 1
    change = usual[:, apart:] - usual[:, :-apart]
    size = np.linalg.norm(change, axis=0)
    # Steady acceleration of the run itself, over as much time.
    between_s = centre_s[apart:] - centre_s[:-apart]
    steady = np.quantile(size / between_s, 0.75) * between_s
    speed = np.linalg.norm(usual, axis=0)
    clear = CLEAR * np.hypot(error[apart:], error[:-apart]) * np.sqrt(np.pi / 2)
    jump_s = np.median(step_s)
    beyond = size - steady
    is_blow = (beyond > HIT_M_S2 * jump_s) & (size > USUAL * steady) & (beyond > clear)
    is_blow &= size > SHARE * np.maximum(speed[:-apart], speed[apart:])
    if not from_rest:
        is_blow &= speed[:-apart] > clear  # what is at rest is let go, not struck
    if not is_blow.any():
        return None
    first = int(np.argmax(is_blow))
    last = first + int(np.argmin(np.append(is_blow[first:], False)))
    # Of the windows that see it, those in whose middle it is: there the change is largest.
    at = first + int(np.argmax(size[first:last]))
    return int(seen[last_before(times_s, place_m, variance, at + STEPS)])


def last_before(times_s: np.ndarray, place_m: np.ndarray, variance: np.ndarray, about: int) -> int:
    """The last frame before a blow that is within `STEPS` frames of `about`."""
    begin, end = max(about - PARABOLA_FRAMES + 1, 0), about + PARABOLA_FRAMES + 1
    times, place = times_s[begin:end] - times_s[about], place_m[:, begin:end]
    floor = FLOOR * float(np.median(variance[begin:end])) * np.eye(len(place))
    left = {}
    for last in range(about - STEPS, about + STEPS + 1):
        sides = slice(None, last + 1 - begin), slice(last + 1 - begin, None)
        if min(len(times[side]) for side in sides) < FEWEST:
            continue
        beside = np.concatenate([_beside(times[side], place[:, side]) for side in sides], axis=1)
        count = beside.shape[1]
        left[last] = count * np.linalg.slogdet(beside @ beside.T / count + floor)[1]
    last = max(last for last, cost in left.items() if cost <= min(left.values()) + AS_WELL)
    for _ in range(SMEARED):
        if continues(times_s, place_m, variance, last):
            break
        last -= 1
    return last


def continues(
    times_s: np.ndarray,
    place_m: np.ndarray,
    variance: np.ndarray,
    last: int,
    own: slice | None = None,
) -> bool:
    """Whether a frame lies where the parabola of others goes on to, `CLEAR` sd at most.

    Args:
      times_s: `[frame]`.
      place_m: `[axis, frame]`.
      variance: `[frame]`, m^2.
      last: the frame.
      own: the others; None: those before it.
    """
    own = slice(max(last - PARABOLA_FRAMES, 0), last) if own is None else own
    since = times_s[own] - times_s[last]
    if len(since) < FEWEST:
        return True
    design = np.vander(since, 3)
    solution = np.linalg.lstsq(design, place_m[:, own].T, rcond=None)[0]
    beside = place_m[:, own].T - design @ solution
    scatter = np.sum(beside**2, axis=0) / max(len(since) - 3, 1)
    known = np.maximum(scatter, variance[last]) * (1 + np.linalg.inv(design.T @ design)[2, 2])
    return bool(np.all((place_m[:, last] - solution[2]) ** 2 <= CLEAR**2 * known))


def _beside(times_s: np.ndarray, place_m: np.ndarray) -> np.ndarray:
    """What a parabola leaves, `[axis, frame]`, m."""
    design = np.vander(times_s, 3)
    return place_m - (design @ np.linalg.lstsq(design, place_m.T, rcond=None)[0]).T


def goes_on(observation: Observation, last: int) -> bool:
    """Whether object 1 still moves after the frame `last`, with more than a tenth of its speed."""
    seen = np.flatnonzero(observation.mask[0])
    at = int(np.searchsorted(seen, last))
    before, after = seen[max(at - STEPS, 0) : at + 1], seen[at + SMEARED : at + SMEARED + STEPS + 1]
    if min(len(before), len(after)) < 2:
        return False
    place, times = observation.position_m[0], observation.times_s
    speeds = [
        np.linalg.norm(place[:, part[-1]] - place[:, part[0]]) / (times[part[-1]] - times[part[0]])
        for part in (before, after)
    ]
    return bool(speeds[1] > GOES_ON * speeds[0])


def _median(values: np.ndarray) -> np.ndarray:
    """Of each window of `STEPS` steps."""
    return np.median(np.lib.stride_tricks.sliding_window_view(values, STEPS), axis=-1)
