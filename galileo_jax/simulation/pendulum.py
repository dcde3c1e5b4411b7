"""A pendulum with known truth: the laws are the engine's, the integrator is SciPy's."""

from collections.abc import Mapping, Sequence
from functools import partial
from typing import Any

import numpy as np

from galileo_jax.model.effects.effect import Effect, Surroundings
from galileo_jax.rollout.engine_pendulum import Swing, make_pendulum, place, rates, start
from galileo_jax.simulation.motion import RECORD_S, Motion
from galileo_jax.simulation.to_event import to_event

TOLERANCES = (1e-11, 1e-13)  # relative, absolute


def swung(
    effects: Sequence[Effect], theta: Mapping[str, Any], scene: Surroundings, seconds: float
) -> Motion:
    """The motion from the start on, from one turning back to the next."""
    pendulum = make_pendulum(effects, theta, scene, np)
    first = start(theta, pendulum)
    times = RECORD_S * np.arange(round(seconds / RECORD_S) + 2)
    rows, turns = np.empty((len(times), 2)), np.zeros(len(times))
    now, time, begin = np.array(first, float), 0.0, 0

    def change(t: float, y: np.ndarray, slip: float) -> np.ndarray:
        return np.hstack(rates(Swing(*y), np.asarray(t), slip, pendulum, scene)[0])

    while begin < len(times):
        here = Swing(*now)
        pulled, excess = rates(here, np.asarray(time), 0.0, pendulum, scene)
        way = np.sign(now[1]) or (np.sign(pulled.turning_rad_s) if excess > 0 else 0.0)
        if way == 0.0:
            rows[begin:], turns[begin:] = now, 0.0
            break
        slip = way if pendulum.has_friction else 0.0

        def turn(t: float, y: np.ndarray, way: float = way, began: float = time) -> float:
            return float(y[1] * way) if pendulum.has_friction and t > began else 1.0

        move = partial(change, slip=slip)
        found = to_event(move, turn, time, now, times[begin:], TOLERANCES)
        until = begin + len(found.rows)
        rows[begin:until] = found.rows
        for i in range(begin, until):
            turns[i] = move(times[i], rows[i])[1]
        begin, time, now = until, found.time_s, found.state
        if not found.is_event:
            break
        now[1] = 0.0
    pairs = zip(rows, turns, strict=True)
    seen = [place(Swing(*row), turn, pendulum, first, scene) for row, turn in pairs]
    position, velocity = (np.array(values).T[None] for values in zip(*seen, strict=True))
    return Motion(times, position, velocity, np.zeros((1, len(times))))
