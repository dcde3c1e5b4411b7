"""A blow, a stop or a bounce: the velocity jumps, and nothing in the scene is there to hit."""

import numpy as np
from jaxtyping import Bool
from scipy import special

from galileo_jax.numerics.least_squares import least_squares
from galileo_jax.numerics.runs import stretches
from galileo_jax.observation.observation import Observation, PointPath

HIT_M_S2 = 20.0  # two g
SHARE = 0.3
CLEAR = 6.0
OFF = 4.0  # standard deviations: beside a blow a frame too few costs less than one too many
USUAL = 4.0
GOES_ON = 0.1  # of the speed: what keeps less has been stopped
STEPS = 3  # on either side
SMEARED = 2  # steps into which the blow itself may fall
PARABOLA_FRAMES, FEWEST = 10, 4  # on either side of a blow
AS_WELL = 9.0  # in -2 log likelihood: three standard deviations
SLOWED, STEADY, STOP_CLEAR, BEFORE = 0.6, 0.9, 5.0, 3  # of a stop
FLOOR = 0.01  # of the track's variance: a few points may leave nothing in some direction
BOUNCE_CHANCE, BOUNCE_SHARE = 1e-6, 0.1  # a flight has tens of frames


def jumps(path: PointPath, most_m_s2: float, clear: float) -> Bool[np.ndarray, " middle"]:
    """Whether the velocity changes beyond an acceleration and noise, for each place but the ends.

    Nothing but a blow accelerates by `most_m_s2`; `clear` standard deviations are no noise.
    """
    step_s, velocity, sd = path.steps
    change = np.linalg.norm(np.diff(velocity[:2]), axis=0)
    return change > most_m_s2 * (step_s[1:] + step_s[:-1]) / 2 + clear * np.hypot(sd[1:], sd[:-1])


def blow_frame(observation: Observation, index: int = 0, from_rest: bool = False) -> int | None:
    """The last frame before an object is struck; None where nothing strikes it.

    With c = v_b - v_a - a d the change of velocity between the medians of the `STEPS` steps on
    either side of a frame, d the time between their middles, a the run's usual acceleration (the
    median of each axis: weight, or a slope's pull), it is a blow if

        |c| > HIT_M_S2 times a step            (no friction, drag or weight accelerates so)
        |c| > SHARE of the speed before        (a bump on the way is none)
        |c| > CLEAR standard deviations of c
        |c| / d > USUAL times what the run's own accelerations are: those of three in four frames,
                  and those just before or just after, whichever are less (lengths may be in units
                  that nobody knows; what sinks in a liquid accelerates in the beginning only)

    so that no single point makes a blow. When it was is told by `last_before`.

    Args:
      observation: its x and y count, and z in space.
      index: of the object.
      from_rest: whether what is at rest may be struck; else it is let go.
    """
    path = observation.path(index)
    if len(path) < 2 * STEPS + SMEARED + 2:
        return None
    step_s, velocity, sd = path.steps
    usual, error = _medians(velocity), _medians(sd) / np.sqrt(STEPS)
    middle_s = _medians(path.times_s[:-1] + step_s / 2)
    # From the middle of one window to that of the next which shares no step with it.
    apart = STEPS + SMEARED - 1
    before, after = slice(None, -apart), slice(apart, None)
    between_s = middle_s[after] - middle_s[before]
    change = usual[:, after] - usual[:, before]
    usual_pull = np.median(change / between_s, axis=1, keepdims=True)
    size = np.linalg.norm(change - usual_pull * between_s, axis=0)
    noise_m_s = np.hypot(error[after], error[before]) * np.sqrt(np.pi / 2)
    # Of their squares noise alone makes so much, across a gap as from one frame to the next.
    own = np.maximum(size**2 - len(change) * noise_m_s**2, 0.0)
    own_m_s2 = np.sqrt(own) / between_s
    beside = np.pad(own_m_s2, apart, constant_values=np.inf)
    beside = np.minimum(beside[: -2 * apart], beside[2 * apart :])
    usual_m_s2 = np.maximum(np.quantile(own_m_s2, 0.75), np.where(beside < np.inf, beside, 0.0))
    steady = usual_m_s2 * between_s
    speed = np.linalg.norm(usual, axis=0)
    clear = CLEAR * noise_m_s
    beyond = size - steady
    is_blow = (beyond > HIT_M_S2 * np.median(step_s)) & (size > USUAL * steady) & (beyond > clear)
    is_blow &= size > SHARE * np.maximum(speed[before], speed[after])
    if not from_rest:
        is_blow &= speed[before] > clear
    if not is_blow.any():
        return None
    # Of the windows that see it, those in whose middle it is: there the change is largest.
    first = stretches(is_blow)[0]
    at = first.start + int(np.argmax(size[first]))
    return int(path.frames[last_before(path, at + STEPS)])


def last_before(path: PointPath, about: int) -> int:
    """The last place before a blow that is within `STEPS` places of `about`.

    One parabola goes to it, one from the next place on. That place is taken with which they leave
    least, or the latest that leaves hardly more, for a frame of the blow itself lies on both. As
    errors may be larger along the way than across, what they leave is the determinant of its
    scatter. A blow that lasts takes further frames: those off the parabola of the frames before.
    """
    begin, end = max(about - PARABOLA_FRAMES + 1, 0), about + PARABOLA_FRAMES + 1
    variance = float(np.median(path.variance_m2[begin:end]))
    floor = FLOOR * variance * np.eye(len(path.place_m))
    cost = {}
    for last in range(about - STEPS, about + STEPS + 1):
        sides = path[begin : last + 1], path[last + 1 : end]
        if min(map(len, sides)) < FEWEST:
            continue
        left = np.concatenate([side.polynomial(2, path.times_s[about]).left for side in sides])
        cost[last] = len(left) * np.linalg.slogdet(left.T @ left / len(left) + floor)[1]
    last = max(last for last, one in cost.items() if one <= min(cost.values()) + AS_WELL)
    for _ in range(SMEARED):
        if continues(path, last):
            break
        last -= 1
    return last


def continues(path: PointPath, last: int, own: slice | None = None, most_sds: float = OFF) -> bool:
    """Whether the parabola of some places, `own`, goes on to another, by `most_sds` at most.

    Without `own` it is that of those before it.
    """
    own = slice(max(last - PARABOLA_FRAMES, 0), last) if own is None else own
    near = path[own]
    if len(near) < FEWEST:
        return True
    fit = near.polynomial(2, path.times_s[last])
    scatter = np.sum(fit.left**2, axis=0) / max(len(near) - 3, 1)
    known = np.maximum(scatter, path.variance_m2[last]) * (1 + fit.inverse[2, 2])
    return bool(np.all((path.place_m[:, last] - fit.solution[2]) ** 2 <= most_sds**2 * known))


def arrest_frame(observation: Observation) -> int | None:
    """The last frame before object 1 is stopped within one step; None where it is not.

    With v_i the speed in the direction of motion, it is stopped at step i if

        v_i < SLOWED v,   and no v_j > SLOWED v after it,   v = median of steps i - 2, i - 3, i - 4
        v_(i-2) > STEADY v                                  (what brakes slows down step by step)
        (v - v_i) / (n steps) > HIT_M_S2                     (and no friction brakes like a wall)
        v > STOP_CLEAR standard deviations of a step

    n is 1, or 2 where the hit is smeared over two steps: v_(i-1) < STEADY v.
    """
    path = observation.path()
    step_s, velocity, speed_sd = path.steps
    for i in range(BEFORE + 1, len(step_s)):
        own = slice(i - 1 - BEFORE, i - 1)
        way = velocity[:, own].sum(axis=1)
        going = way @ velocity / max(float(np.linalg.norm(way)), np.finfo(float).tiny)
        usual = np.median(going[own])
        is_clear = usual > STOP_CLEAR * np.median(speed_sd[own])
        is_smeared = going[i - 1] <= STEADY * usual
        braked_m_s2 = (usual - going[i]) / step_s[i - is_smeared : i + 1].sum()
        is_hit = braked_m_s2 > HIT_M_S2 and going[i - 2] > STEADY * usual
        if is_clear and is_hit and going[i:].max() < SLOWED * usual:
            return int(path.frames[i - 1 if is_smeared else i])
    return None


def goes_on(observation: Observation, last: int) -> bool:
    """Whether object 1 still moves after the frame `last`, with more than a tenth of its speed."""
    path = observation.path()
    at = int(np.searchsorted(path.frames, last))
    parts = path[max(at - STEPS, 0) : at + 1], path[at + SMEARED : at + SMEARED + STEPS + 1]
    if min(map(len, parts)) < 2:
        return False
    before, after = (
        np.linalg.norm(part.place_m[:, -1] - part.place_m[:, 0]) / np.ptp(part.times_s)
        for part in parts
    )
    return bool(after > GOES_ON * before)


def bounce_frame(observation: Observation) -> int | None:
    """The last frame before object 1 bounces for the first time in space; None: never.

    Around every frame k a path of `PARABOLA_FRAMES` to either side is laid, which may bend once,

        x(t) = x_0 + v t + a t^2 / 2 + c max(t - t_k, 0)      for each axis

    and it is a bounce where the bend c is

        c' S^-1 c / q        is what BOUNCE_CHANCE makes of errors alone; S is the scatter of what
                             the path leaves, of few frames (hence an F ratio), q the bend's element
                             of the inverse normal matrix
        |c| > BOUNCE_SHARE |v|    drag that changes on the way, bent at its middle, is far less

    S is that of the track itself, per direction: where times are not known well errors along the
    way are several times those across, and a ball that grazes the table changes its velocity
    across.
    """
    path = observation.path()
    if len(path) < 2 * FEWEST:
        return None
    middles = range(FEWEST - 1, len(path) - FEWEST)
    chance = np.array([_chance_of_bend(path, k) for k in middles])
    bounces = stretches(chance < BOUNCE_CHANCE)
    if not bounces:
        return None
    at = middles[bounces[0].start + int(np.argmin(chance[bounces[0]]))]
    return int(path.frames[last_before(path, at)])


def _chance_of_bend(path: PointPath, middle: int) -> float:
    """Of so clear a bend between a frame and the next without a bounce; 1 where it is too small."""
    part = path[max(middle - PARABOLA_FRAMES + 1, 0) : middle + PARABOLA_FRAMES + 1]
    since = part.times_s - (path.times_s[middle] + path.times_s[middle + 1]) / 2
    design = np.stack([np.ones_like(since), since, since**2, np.maximum(since, 0.0)], axis=1)
    fit = least_squares(design, part.place_m.T)
    freedom, axes = len(part) - design.shape[1], len(part.place_m)
    bend, speed = fit.solution[3], float(np.linalg.norm(fit.solution[1] + fit.solution[3] / 2))
    if freedom <= axes or np.linalg.norm(bend) < BOUNCE_SHARE * speed:
        return 1.0
    scatter = fit.left.T @ fit.left / freedom
    scatter += np.finfo(float).eps * np.trace(scatter) * np.eye(axes)
    squared = float(bend @ np.linalg.solve(scatter, bend) / fit.inverse[3, 3])
    spare = freedom - axes + 1
    return float(special.fdtrc(axes, spare, squared * spare / (freedom * axes)))


def _medians(values: np.ndarray) -> np.ndarray:
    """Of each window of `STEPS` steps."""
    windows = np.lib.stride_tricks.sliding_window_view(values, STEPS, axis=-1)
    return np.median(windows, axis=-1)
