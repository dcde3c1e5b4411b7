"""Levenberg-Marquardt steps of many points at once, inside the priors' edges.

Accelerations are linear in coefficients of friction and in strengths of effects. In z, in which
every prior is N(0, 1), these hardly move at the edge of a prior: a step that is straight in z
would leap over all that matters or not come back. So steps are straight in the units that motion
is linear in (a strength that multiplies friction: in their product), and none goes further than
most of the way to an edge; a parameter that would is held there, and the others are solved for
again (an active set).

Source: Levenberg (1944), Marquardt (1963, 10.1137/0111030); Nocedal and Wright (2006), ch. 16.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from scipy.special import ndtr, ndtri

from galileo_jax.model.parameters import Parameter, PriorTable

# Against the columns' sizes. Valleys are narrow (masses against friction): most of the range is
# needed below 1e-2, where steps along them differ.
DAMPINGS = np.array([0.0, 1e-5, 1e-4, 1e-3, 1e-2, 1e-1, 1e1])
# What is tried: a damping, and a share of its step. Damping holds back most what the data tell
# least, which in a narrow, bent valley is the way along it: there a part of the whole step is
# better.
TRIED_DAMPING = np.append(DAMPINGS, [0.0, 0.0, 1e-4])
TRIED_SHARE = np.append(np.ones(len(DAMPINGS)), [0.3, 0.1, 0.3])
LEFT_OF_WAY = 0.1  # to the edge of a prior, by the longest step
FURTHEST_Z = 7.0  # beyond, a bounded parameter is at its edge to twelve digits
LOG_NORMAL, UNIFORM = 1, 2  # `PriorTable.kind`


@dataclass(frozen=True)
class Edges:
    """Where priors end.

    Attributes:
      is_bounded: `[parameter]`, between two values (a coefficient of friction).
      is_strength: `[parameter]`, of an effect, positive. Masses are not: motion knows their
        ratio.
      log_sd: `[parameter]`, of a strength's logarithm.
      multiplied: `[parameter]`, index of the coefficient of friction that it multiplies; its own
        where there is none.
    """

    is_bounded: np.ndarray
    is_strength: np.ndarray
    log_sd: np.ndarray
    multiplied: np.ndarray

    @classmethod
    def of(cls, parameters: Sequence[Parameter]) -> "Edges":
        """The edges of these parameters' priors."""
        table = PriorTable.of(parameters)
        is_strength = (table.kind == LOG_NORMAL) & [p.role == "effect" for p in parameters]
        where = {p.name: i for i, p in enumerate(parameters)}
        multiplied = [where.get(p.multiplies or p.name, i) for i, p in enumerate(parameters)]
        log_sd = np.where(is_strength, table.b, 1.0)
        return cls(table.kind == UNIFORM, is_strength, log_sd, np.array(multiplied))

    def reach(self, z: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """The shortest and the longest step from z `[..., parameter]`: most of the way."""
        share, slope = _share(z)
        most = 1 - LEFT_OF_WAY
        low = np.where(self.is_bounded, -most * share / slope, -np.inf)
        low = np.where(self.is_strength, -most / self.log_sd, low)
        return low, np.where(self.is_bounded, most * (1 - share) / slope, np.inf)

    def curve(self, z: np.ndarray, step: np.ndarray) -> np.ndarray:
        """Where a step from z ends that is as straight as can be; to first order z + step.

        What multiplies a coefficient k is straight in the product: with s k + k ds + s dk for
        the product's end, s moves by ds k / (k + dk).
        """
        low, high = self.reach(z)
        step = np.clip(step, low, high)
        share, slope = _share(z)
        there = share + slope * step
        shrunk = np.where(self.is_bounded, share / there, 1.0)[..., self.multiplied]
        alone = self.multiplied == np.arange(len(self.multiplied))
        step = np.maximum(np.where(alone, step, step * shrunk), low)
        grown = np.where(self.is_strength, self.log_sd * step, 0.0)
        straight = np.where(self.is_strength, z + np.log1p(grown) / self.log_sd, z + step)
        return np.where(step == 0, z, np.where(self.is_bounded, ndtri(there), straight))


def _share(z: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """How far a bounded parameter is on its way from edge to edge, and the slope of that in z."""
    z = np.clip(z, -FURTHEST_Z, FURTHEST_Z)
    return ndtr(z), np.exp(-0.5 * z**2) / np.sqrt(2 * np.pi)


class Damped(NamedTuple):
    """Of many points: the linear problems with all dampings that are tried.

    Attributes:
      jacobian: for each clip `[point, value, parameter]`.
      free: `[point, parameter]`.
      matrix: for each point `[tried, free parameter, free parameter]`.
    """

    jacobian: Sequence[np.ndarray]
    free: np.ndarray
    matrix: Sequence[np.ndarray]

    @classmethod
    def of(cls, free: np.ndarray, jacobian: Sequence[np.ndarray]) -> "Damped":
        """Of `[point, parameter]` and slopes, as the attributes say."""
        matrices = []
        for normal, own in zip(normal_matrices(jacobian), free, strict=True):
            block = normal[np.ix_(own, own)] + np.eye(int(own.sum()))
            matrices.append(block + TRIED_DAMPING[:, None, None] * np.diag(np.diag(block)))
        return cls(jacobian, free, matrices)

    def steps(
        self,
        z: np.ndarray,
        white: Sequence[np.ndarray],
        reach: tuple[np.ndarray, np.ndarray],
        which: np.ndarray,
    ) -> np.ndarray:
        """Damped steps.

        Args:
          z: `[point, 1 or step, parameter]`, where they begin.
          white: residuals there, `[point, 1 or step, value]`, clip by clip.
          reach: the shortest and the longest step, as `z`.
          which: `[point, step]`, index of each one's damping and share.

        Returns:
          `[point, step, parameter]`.
        """
        pairs = zip(self.jacobian, white, strict=True)
        slope = z + np.sum([np.einsum("bvi,bdv->bdi", j, w) for j, w in pairs], axis=0)
        shape = (*which.shape, z.shape[-1])
        slope, low, high = (np.broadcast_to(array, shape) for array in (slope, *reach))
        steps = np.zeros(shape)
        for i, own in enumerate(self.free):
            matrix = self.matrix[i][which[i]]
            found = np.linalg.solve(matrix, -slope[i][:, own, None])[..., 0]
            sides = low[i][:, own], high[i][:, own]
            for d in np.flatnonzero(((found < sides[0]) | (found > sides[1])).any(axis=1)):
                found[d] = _held_back(
                    matrix[d], slope[i, d, own], found[d], sides[0][d], sides[1][d]
                )
            steps[i][:, own] = found
        return TRIED_SHARE[which][..., None] * np.where(np.isfinite(steps), steps, 0.0)


def _held_back(
    matrix: np.ndarray, slope: np.ndarray, step: np.ndarray, low: np.ndarray, high: np.ndarray
) -> np.ndarray:
    """A step inside a box: what would leave it stays at its side, and the others know."""
    held = np.zeros(len(step), bool)
    for _ in range(len(step)):
        out = ~held & ((step < low) | (step > high))
        if not out.any():
            break
        held |= out
        step = np.where(held, np.clip(step, low, high), 0.0)
        left = ~held
        right = slope[left] + matrix[np.ix_(left, held)] @ step[held]
        step[left] = np.linalg.solve(matrix[np.ix_(left, left)], -right)
    return step


def normal_matrices(jacobian: Sequence[np.ndarray]) -> np.ndarray:
    """J^T J of all clips, `[point, parameter, parameter]`."""
    return np.sum([np.einsum("bvi,bvj->bij", j, j) for j in jacobian], axis=0)
