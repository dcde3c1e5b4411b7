"""Accelerations at random: air that moves, a thread that gives way."""

import numpy as np

from galileo_jax.statespace.linear_sde import covariance, transitions
from galileo_jax.statespace.term import Patterns, Seen, of_axis, term

LASTS_S = 0.05
MEANING = "accelerations vary by {size} for a twentieth of a second at a time"


@term("gusts", MEANING, "m/s^2", median=lambda _: 0.02, factor=4.0)
def gusts(seen: Seen) -> Patterns | None:
    """Of each axis on its own; none on a surface, a spring or a thread."""
    scene, times = seen.scene, seen.observation.times_s
    if scene.has_surface or len(times) < 2 or {"spring", "pendulum"} & set(scene.laws):
        return None
    drift, diffusion = np.zeros((2, len(times) - 1, 3, 3))
    drift[:, 0, 1] = drift[:, 1, 2] = 1.0
    drift[:, 2, 2] = -1 / LASTS_S
    diffusion[:, 2, 2] = 2 / LASTS_S
    place = np.tile([[1.0, 0.0, 0.0]], (len(times), 1, 1))
    way = transitions(drift, diffusion, np.diff(times))
    found = covariance(way, np.diag([0.0, 0.0, 1.0]), place)
    return of_axis(found[:, 0, :, 0], seen)
