"""A pendulum with known truth: the laws are the engine's, the integrator is SciPy's."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from galileo_jax.model.effects.effect import Effect, Surroundings
from galileo_jax.rollout.particle_pendulum import Swing, make_pendulum, place, rates, start
from galileo_jax.simulation.motion import RECORD_S, Motion
from galileo_jax.simulation.to_event import Stretch, by_events

TOLERANCES = (1e-11, 1e-13)  # relative, absolute


def swung(
    effects: Sequence[Effect], theta: Mapping[str, Any], scene: Surroundings, seconds: float
) -> Motion:
    """The motion from the start on, from one turning back to the next."""
    pendulum = make_pendulum(effects, theta, scene, np)
    first = start(theta, pendulum)
    times = RECORD_S * np.arange(round(seconds / RECORD_S) + 2)

    def stretch(began: float, state: np.ndarray, is_turned: bool) -> Stretch:
        now = np.array([state[0], 0.0 if is_turned else state[1]])
        pulled, excess = rates(Swing(*now), np.asarray(began), 0.0, pendulum, scene)
        way = np.sign(now[1]) or (np.sign(pulled.turning_rad_s) if excess > 0 else 0.0)
        slip = way if pendulum.has_friction else 0.0

        def change(t: float, y: np.ndarray) -> np.ndarray:
            if way == 0.0:
                return np.zeros(2)
            return np.hstack(rates(Swing(*y), np.asarray(t), slip, pendulum, scene)[0])

        def turn(t: float, y: np.ndarray) -> float:
            return float(y[1] * way) if slip and t > began else 1.0

        return Stretch(now, change, turn)

    swings, changes, _ = by_events(stretch, np.array(first, float), times, TOLERANCES)
    seen = [
        place(Swing(*swing), change(time, swing)[1], pendulum, first, scene)
        for time, swing, change in zip(times, swings, changes, strict=True)
    ]
    position, velocity = (np.array(values).T[None] for values in zip(*seen, strict=True))
    return Motion(times, position, velocity, np.zeros((1, len(times))))
