"""A blow, or a stop: the velocity jumps, and nothing in the scene is there to hit.

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

from galileo_jax.observation.observation import Observation, PointPath

HIT_M_S2 = 20.0  # two g
SHARE = 0.3
CLEAR = 6.0
USUAL = 4.0
GOES_ON = 0.1  # of the speed: what keeps less has been stopped
STEPS = 3  # on either side
SMEARED = 2  # steps into which the blow itself may fall
PARABOLA_FRAMES, FEWEST = 10, 4  # on either side of a blow
AS_WELL = 9.0  # in -2 log likelihood: three standard deviations
SLOWED, STEADY, STOP_CLEAR, BEFORE = 0.6, 0.9, 5.0, 3  # of a stop
SMEARED_FRAMES = 1
"""Of a video: the hit falls into an exposure, whose frame shows neither."""
FLOOR = 0.01  # of the track's variance: a few points may leave nothing in some direction


def blow_frame(observation: Observation, index: int = 0, from_rest: bool = False) -> int | None:
    """The last frame before an object is struck; None where nothing strikes it.

    Args:
      observation: its x and y count, and z in space.
      index: of the object.
      from_rest: whether what is at rest may be struck; else it is let go.
    """
    path = observation.path(index)
    if len(path) < 2 * STEPS + SMEARED + 2:
        return None
    step_s, velocity, sd = path.steps
    middle_s = path.times_s[:-1] + step_s / 2
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
    return int(path.frames[last_before(path, at + STEPS)])


def last_before(path: PointPath, about: int) -> int:
    """The last place before a blow that is within `STEPS` places of `about`."""
    begin, end = max(about - PARABOLA_FRAMES + 1, 0), about + PARABOLA_FRAMES + 1
    times, place = path.times_s[begin:end] - path.times_s[about], path.place_m[:, begin:end]
    floor = FLOOR * float(np.median(path.variance_m2[begin:end])) * np.eye(len(place))
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
        if continues(path, last):
            break
        last -= 1
    return last


def continues(path: PointPath, last: int, own: slice | None = None) -> bool:
    """Whether the parabola of some places, `own`, goes on to another, by `CLEAR` sd at most.

    Without `own` it is that of those before it.
    """
    own = slice(max(last - PARABOLA_FRAMES, 0), last) if own is None else own
    place_m = path.place_m
    since = path.times_s[own] - path.times_s[last]
    if len(since) < FEWEST:
        return True
    design = np.vander(since, 3)
    solution = np.linalg.lstsq(design, place_m[:, own].T, rcond=None)[0]
    beside = place_m[:, own].T - design @ solution
    scatter = np.sum(beside**2, axis=0) / max(len(since) - 3, 1)
    known = np.maximum(scatter, path.variance_m2[last]) * (
        1 + np.linalg.inv(design.T @ design)[2, 2]
    )
    return bool(np.all((place_m[:, last] - solution[2]) ** 2 <= CLEAR**2 * known))


def _beside(times_s: np.ndarray, place_m: np.ndarray) -> np.ndarray:
    """What a parabola leaves, `[axis, frame]`, m."""
    design = np.vander(times_s, 3)
    return place_m - (design @ np.linalg.lstsq(design, place_m.T, rcond=None)[0]).T


def arrest_frame(observation: Observation) -> int | None:
    """The last frame before object 1 is stopped within one step; None where it is not.

    With v_i the speed in the direction of motion, it is stopped at step i if

        v_i < SLOWED v,   and no v_j > SLOWED v after it,   v = median of steps i - 2, i - 3, i - 4
        v_(i-2) > STEADY v                                  (what brakes slows down step by step)
        (v - v_i) / n steps > HIT_M_S2                      (and no friction brakes like a wall)
        v > STOP_CLEAR standard deviations of a step

    n is 1, or 2 where the hit is smeared over two steps: v_(i-1) < STEADY v.
    """
    path = observation.path()
    step_s, velocity, speed_sd = path.steps
    for i in range(BEFORE + 1, len(step_s)):
        way = velocity[:, i - 1 - BEFORE : i - 1].sum(axis=1)
        going = way @ velocity / max(float(np.hypot(*way)), np.finfo(float).tiny)
        usual = np.median(going[i - 1 - BEFORE : i - 1])
        is_clear = usual > STOP_CLEAR * np.median(speed_sd[i - 1 - BEFORE : i - 1])
        is_smeared = going[i - 1] <= STEADY * usual
        braked_m_s2 = (usual - going[i]) / (step_s[i] * (2 if is_smeared else 1))
        is_hit = braked_m_s2 > HIT_M_S2 and going[i - 2] > STEADY * usual
        if is_clear and is_hit and going[i:].max() < SLOWED * usual:
            return int(path.frames[i - 1 if is_smeared else i])
    return None


def goes_on(observation: Observation, last: int) -> bool:
    """Whether object 1 still moves after the frame `last`, with more than a tenth of its speed."""
    path = observation.path()
    at = int(np.searchsorted(path.frames, last))
    before = path[max(at - STEPS, 0) : at + 1]
    after = path[at + SMEARED : at + SMEARED + STEPS + 1]
    if min(len(before), len(after)) < 2:
        return False
    speeds = [
        np.linalg.norm(part.place_m[:, -1] - part.place_m[:, 0]) / np.ptp(part.times_s)
        for part in (before, after)
    ]
    return bool(speeds[1] > GOES_ON * speeds[0])


def _median(values: np.ndarray) -> np.ndarray:
    """Of each window of `STEPS` steps."""
    return np.median(np.lib.stride_tricks.sliding_window_view(values, STEPS), axis=-1)
