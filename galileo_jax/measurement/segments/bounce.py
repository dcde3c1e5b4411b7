"""A bounce in space: the velocity jumps between two frames, whatever drives the ball else.

Around every frame k a path of PARABOLA_FRAMES to either side is laid, which may bend once,

    x(t) = x_0 + v t + a t^2 / 2 + c max(t - t_k, 0)      for each axis

and it is a bounce where the bend c is

    c' S^-1 c / q        is what CHANCE makes of errors alone; S is the scatter of what the path
                         leaves, of few frames (hence an F ratio), q the bend's element of the
                         inverse normal matrix
    |c| > SHARE |v|      drag that changes on the way, bent at its middle, is far less

S is that of the track itself, per direction: where times are not known well errors along the way
are several times those across, and a ball that grazes the table changes its velocity across.
"""

import numpy as np
from scipy import special

from galileo_jax.measurement.segments.blow import FEWEST, PARABOLA_FRAMES, last_before
from galileo_jax.observation.observation import Observation

CHANCE = 1e-6  # a flight has tens of frames
SHARE = 0.1
UNKNOWNS = 4  # of the path, per axis


def bounce_frame(observation: Observation) -> int | None:
    """The last frame before object 1 bounces for the first time; None: never.

    Args:
      observation: a track in space, three axes.
    """
    path = observation.path()
    if len(path) < 2 * FEWEST:
        return None
    middles = range(FEWEST - 1, len(path) - FEWEST)
    chance = np.array([_chance(path.times_s, path.place_m, k) for k in middles])
    is_bounce = chance < CHANCE
    if not is_bounce.any():
        return None
    first = int(np.argmax(is_bounce))
    last = first + int(np.argmin(np.append(is_bounce[first:], False)))
    at = middles[first + int(np.argmin(chance[first:last]))]
    return int(path.frames[last_before(path, at)])


def _chance(times_s: np.ndarray, place_m: np.ndarray, middle: int) -> float:
    """Of so clear a bend between a frame and the next without a bounce; 1 where it is too small."""
    part = slice(max(middle - PARABOLA_FRAMES + 1, 0), middle + PARABOLA_FRAMES + 1)
    times, place = times_s[part], place_m[:, part]
    since = times - (times_s[middle] + times_s[middle + 1]) / 2
    design = np.stack([np.ones_like(since), since, since**2, np.maximum(since, 0.0)], axis=1)
    inverse = np.linalg.inv(design.T @ design)
    found = inverse @ design.T @ place.T
    left = place - (design @ found).T
    freedom = len(times) - UNKNOWNS
    bend, speed = found[3], float(np.linalg.norm(found[1] + found[3] / 2))
    if freedom <= len(place) or np.linalg.norm(bend) < SHARE * speed:
        return 1.0
    scatter = left @ left.T / freedom
    scatter += np.finfo(float).eps * np.trace(scatter) * np.eye(len(place))
    squared = float(bend @ np.linalg.solve(scatter, bend) / inverse[3, 3])
    spare = freedom - len(place) + 1
    return float(special.fdtrc(len(place), spare, squared * spare / (freedom * len(place))))
