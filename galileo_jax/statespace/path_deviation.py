"""How deviations of bodies on a path go on: place, speed, and an excess of friction for each.

    d ds = dv dt,    d dv = -n kappa dt,    d kappa = -(|v| / l) kappa dt + sqrt(2 |v| / l) dB

while a body moves; at rest it stays where it is. A hit carries what the rear body's deviation is
to both, as the time and speed at which it comes change: s+ = (v+ / v-) s-, and speeds alike
(the saltation matrix of a hit on what rests).
"""

from collections.abc import Sequence

import numpy as np
from jaxtyping import Float

from galileo_jax.statespace.kinematics import Kinematics
from galileo_jax.statespace.linear_sde import Transitions, covariance, transitions

PLACE, SPEED, FRICTION, NUM = 0, 1, 2, 3


def deviations(
    motion: Kinematics,
    length_m: float = np.inf,
    friction: float = 0.0,
    pushed: Float[np.ndarray, "step object object"] | None = None,
    jumps: Float[np.ndarray, "step object"] | None = None,
    shown: Sequence[int] = (PLACE,),
) -> Float[np.ndarray, "frame shown frame shown"]:
    """The covariance of deviations along the path, m^2, and of what else is `shown` of the state.

    The places of all objects come first, then the next of all. Friction varies over `length_m`, by
    the standard deviation `friction` of its coefficient. `pushed`: covariance of white
    accelerations in each step, m^2/s^3. `jumps`: standard deviation of each speed's, m/s.
    """
    count, frames = motion.speed_m_s.shape
    size, steps = NUM * count, frames - 1
    drift, diffusion = np.zeros((2, steps, size, size))
    speed = (motion.speed_m_s[:, 1:] + motion.speed_m_s[:, :-1]) / 2
    normal = (motion.normal_m_s2[:, 1:] + motion.normal_m_s2[:, :-1]) / 2
    start = np.zeros((size, size))
    for i in range(count):
        place, fast, rub = NUM * i + PLACE, NUM * i + SPEED, NUM * i + FRICTION
        moves = motion.moves[i]
        drift[moves, place, fast] = 1.0
        drift[moves, fast, rub] = -normal[i, moves]
        rate = np.where(moves, speed[i], 0.0) / length_m
        drift[:, rub, rub] = -rate
        diffusion[:, rub, rub] = 2 * rate * friction**2
        start[rub, rub] = friction**2
    if pushed is not None:
        fast = NUM * np.arange(count) + SPEED
        both = motion.moves[:, None] & motion.moves[None]
        diffusion[:, fast[:, None], fast] += pushed * np.moveaxis(both, -1, 0)
    way = transitions(drift, diffusion, motion.step_s)
    way = _with_events(way, motion, jumps)
    which = np.add.outer(shown, NUM * np.arange(count)).reshape(-1)
    seen = np.zeros((frames, len(which), size))
    seen[:, np.arange(len(which)), which] = 1.0
    return covariance(way, start, seen)


def _with_events(way: Transitions, motion: Kinematics, jumps: np.ndarray | None) -> Transitions:
    """Speeds end where bodies rest; hits change and pass on deviations; speeds jump."""
    step, noise = way.step.copy(), way.noise.copy()
    count = len(motion.moves)
    for hit in motion.hits:
        salt = np.eye(step.shape[-1])
        rear, front = NUM * hit.rear, NUM * hit.front
        for part in (PLACE, SPEED):
            salt[front + part, front + part] = 0.0  # it rested where it was
            salt[front + part, rear + part] = hit.given
            salt[rear + part, rear + part] = hit.kept
        step[hit.step] = salt @ step[hit.step]
        noise[hit.step] = salt @ noise[hit.step] @ salt.T
    if jumps is not None:
        fast = NUM * np.arange(count) + SPEED
        noise[:, fast, fast] += jumps**2
    for i in range(count):
        # What rests in a step has no speed at its end.
        for k in np.flatnonzero(~motion.moves[i]):
            step[k, NUM * i + SPEED] = 0.0
            noise[k, NUM * i + SPEED] = 0.0
            noise[k, :, NUM * i + SPEED] = 0.0
    return Transitions(step, noise)
