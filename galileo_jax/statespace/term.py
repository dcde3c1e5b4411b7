"""A term: a random function that no model knows, at unit size, and a prior of its size."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from galileo_jax.model.effects.effect import Surroundings
from galileo_jax.numerics.random_patterns import random_patterns
from galileo_jax.observation.observation import Observation
from galileo_jax.statespace.kinematics import Kinematics

SMALLEST = 1e-7  # of the largest pattern's variance; what is smaller is left out
USUAL = 2.0  # standard deviations of the prior of a size: larger is more than usual

Patterns = Float[np.ndarray, "pattern object axis frame"]


@dataclass(frozen=True)
class Seen:
    """What terms are made of."""

    observation: Observation  # the data
    scene: Surroundings  # what they show
    motion: Kinematics | None  # along the path; None where no surface leads the bodies


FromSeen = Callable[[Seen], Patterns | None]


@dataclass(frozen=True)
class Term:
    """A random function of unknown size."""

    name: str  # as in `imperfections` of result.json
    meaning: str  # one sentence for the user, with {size}
    unit: str  # of the size
    # Of the size's log-normal prior; `median` maps what was seen to it
    median: Callable[[Seen], float]
    factor: float
    made: FromSeen  # `patterns`; None where the term has no place
    is_of_marks: bool = False  # whether it is where bodies are seen, and not where they are

    def patterns(self, seen: Seen) -> Patterns:
        """Whose squares sum to the covariance at unit size, m; none where it has no place."""
        found = self.made(seen)
        return np.zeros((0, *seen.observation.position_m.shape)) if found is None else found


def along_path(
    covariance: Float[np.ndarray, "frame object frame object"], motion: Kinematics
) -> Patterns | None:
    """Patterns of deviations along the path, of which `covariance` is that of all bodies, m^2."""
    frames, count = covariance.shape[:2]
    flat = covariance.reshape(frames * count, -1)
    if not flat.any():
        return None
    patterns = random_patterns(flat, SMALLEST).reshape(-1, frames, count)
    return np.einsum("mto,oat->moat", patterns, motion.tangent)


def of_axis(covariance: Float[np.ndarray, "frame frame"], seen: Seen) -> Patterns:
    """The same patterns in each axis of each body, independent of each other."""
    patterns = random_patterns(covariance, SMALLEST)
    shape = seen.observation.position_m.shape
    num_axes = shape[1] - int(seen.observation.is_turning)
    found = np.zeros((shape[0], num_axes, len(patterns), *shape))
    for i in range(shape[0]):
        for axis in range(num_axes):
            found[i, axis, :, i, axis] = patterns
    return found.reshape(-1, *shape)
