"""A proposal along a ridge: where one direction of a posterior bends all the others.

Along its least determined directions a posterior may be a crescent. A drag, the power of the speed
that it grows with, and friction make up for each other over hundreds of the standard deviations of
what is known best, and not in proportion. No map of a few powers (`transport_map.py`) follows
that: draws beside the ridge count for nothing, and those that count are all from its middle. Of a
power that was known to 0.2 they said 0.08, and its evidence came out 1.6 nats too low. But at each
place along the way all the others are normal about where they are best:

    q(u) = q(a) t(others | best at a, covariance at a),    a = u along the direction

Both are found at knots and interpolated; q(a) is what Laplace's method gives for the others at a.

Source: H. Rue, S. Martino, N. Chopin, Approximate Bayesian inference for latent Gaussian models by
using integrated nested Laplace approximations, J. R. Stat. Soc. B 71 (2009), 319.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float
from scipy.special import logsumexp

from galileo_jax.inference.fits.laplace import GradientFit
from galileo_jax.inference.fits.normal_matrix import symmetric_root
from galileo_jax.inference.fits.residuals import Batch, Residuals, quadratic
from galileo_jax.inference.fits.t_proposal import log_student_t, student_t
from galileo_jax.inference.fits.transport_map import Valley
from galileo_jax.inference.joint_problem import NOISE_SD

BENT = 3.0  # standard deviations of a stiffer direction, one along a direction: a map follows less
STEP, MOST_STEPS = 0.5, 10  # standard deviations along the way; to each side
DESCENDS = 10  # steps of Gauss and Newton at a knot, at most
SHORTER = 0.25  # a step that leads uphill
SETTLED_NATS = 0.05  # that a further step promises: a place is found
LOST_NATS = 0.5  # where these are still promised, the ridge was lost
FAINT_NATS = 10.0  # below the best: there the ridge ends
CELLS = 256
FLATTER = 0.8  # power of q(a): what draws must be wider than what is drawn


@dataclass(frozen=True)
class Ridge:
    """The proposal, in straight coordinates u with `z = mode + R u` (`Valley.root`).

    Attributes:
      valley: whose mode and R these are.
      free: `[parameter]`, those that R leads along.
      direction: the column of R that the way goes along.
      knots: `[knot]`, a, ascending.
      best: of a, the others, `[point, other]`.
      root: `[knot, other, other]`, the symmetric root of the others' precision.
      edges: `[cell + 1]`, of a.
      log_share: `[cell]`, of q(a), in a cell.
    """

    valley: Valley
    free: Bool[np.ndarray, " parameter"]
    direction: int
    knots: Float[np.ndarray, " knot"]
    best: Callable[[np.ndarray], np.ndarray]
    root: Float[np.ndarray, "knot other other"]
    edges: Float[np.ndarray, " edge"]
    log_share: Float[np.ndarray, " cell"]

    def draw(self, generator: np.random.Generator, num: int) -> tuple[np.ndarray, np.ndarray]:
        """Points z, `[draw, parameter]`, and their log density."""
        cell = generator.choice(len(self.log_share), num, p=np.exp(self.log_share))
        a = self.edges[cell] + np.diff(self.edges)[cell] * generator.random(num)
        t = student_t(generator, num, len(self.valley.axes)) @ self.valley.axes
        t = np.delete(t, self.direction, axis=1)
        others = self.best(a) + np.linalg.solve(self._root_at(a), t[..., None])[..., 0]
        z = self.valley.mode + np.insert(others, self.direction, a, axis=1) @ self.valley.root.T
        return z, self.log_density(z)

    def log_density(self, z: Float[np.ndarray, "point parameter"]) -> Float[np.ndarray, " point"]:
        """Of q at points z; -inf beyond the ends of the ridge."""
        u = self.valley.straight(z, self.free) @ self.valley.axes
        a, others = u[:, self.direction], np.delete(u, self.direction, axis=1)
        cell = np.searchsorted(self.edges, a) - 1
        is_inside = (cell >= 0) & (cell < len(self.log_share))
        cell, a = np.where(is_inside, cell, 0), np.where(is_inside, a, self.edges[0])
        root = self._root_at(a)
        with np.errstate(over="ignore", invalid="ignore"):  # far off, where it draws none
            t = np.einsum("pij,pj->pi", root, others - self.best(a))
            far = np.nan_to_num(np.sum(t**2, axis=1), nan=np.inf)
        volume = np.linalg.slogdet(root)[1]
        along = self.log_share[cell] - np.log(np.diff(self.edges)[cell])
        found = along + log_student_t(far, t.shape[1]) + volume - self.valley.log_volume
        return np.where(is_inside, found, -np.inf)

    def _root_at(self, a: np.ndarray) -> np.ndarray:
        """Between knots in proportion, `[point, other, other]`."""
        after = np.clip(np.searchsorted(self.knots, a), 1, len(self.knots) - 1)
        low, high = self.knots[after - 1], self.knots[after]
        share = ((a - low) / (high - low))[:, None, None]
        return (1 - share) * self.root[after - 1] + share * self.root[after]


class _Places(NamedTuple):
    """Places on the ridge, and the misfit round them in u; see `Quadratic`."""

    u: Float[np.ndarray, "place direction"]
    cost: Float[np.ndarray, " place"]
    gradient: Float[np.ndarray, "place direction"]
    normal: Float[np.ndarray, "place direction direction"]


def bent_direction(valley: Valley) -> int | None:
    """The direction along which others bend so much that the map does not follow; None: none is."""
    bends = np.abs(valley.quadratic).max(axis=0)
    return int(bends.argmax()) if bends.max() > BENT else None


def ridge_along(
    fit: GradientFit, valley: Valley, direction: int, residuals: Residuals
) -> Ridge | None:
    """The ridge through a fit; None where it cannot be followed to either side.

    Args:
      fit: the mode.
      valley: round it.
      direction: which the way goes along.
      residuals: of the trials that were fitted.
    """
    from scipy.interpolate import CubicSpline  # most fits never come here

    size = valley.root.shape[1] - (len(fit.z) - len(fit.steps))
    others = np.delete(np.arange(size), direction)
    look = _looker(fit, valley.root[: len(fit.steps), :size], residuals)
    known = [look(np.zeros((1, size)))]
    for side in (STEP, -STEP):
        known += _one_way(look, known[0], direction, side)
    places = _Places(*(np.concatenate(values) for values in zip(*known, strict=True)))
    order = np.argsort(places.u[:, direction])
    if len(order) < 3:
        return None
    u, cost, _, normal = (values[order] for values in places)
    root = symmetric_root(normal[:, others[:, None], others])
    log_q = -cost - np.linalg.slogdet(root)[1]
    knots, line = u[:, direction], u[:, others]
    edges = np.linspace(knots[0], knots[-1], CELLS + 1)
    log_share = FLATTER * np.interp((edges[1:] + edges[:-1]) / 2, knots, log_q)
    # Noise scales, behind the others, hardly depend on these.
    num_noise = valley.root.shape[1] - size
    line = np.pad(line, ((0, 0), (0, num_noise)))
    whole = np.tile(np.eye(size - 1 + num_noise), (len(knots), 1, 1))
    whole[:, : size - 1, : size - 1] = root
    log_share -= logsumexp(log_share)
    best = CubicSpline(knots, line)
    return Ridge(valley, fit.free, direction, knots, best, whole, edges, log_share)


def _looker(
    fit: GradientFit, root: Float[np.ndarray, "parameter direction"], residuals: Residuals
) -> Callable[[np.ndarray], _Places]:
    """Of places `[place, direction]` what the misfit is round them."""
    count = len(fit.steps)
    noise = np.exp(NOISE_SD * fit.z[count:])

    def look(u: np.ndarray) -> _Places:
        z = fit.z[:count] + u @ root.T
        free = np.broadcast_to(fit.free[:count], z.shape)
        batch = Batch(z, free, np.tile(noise, (len(z), 1)))
        slopes = residuals.slopes(batch, np.tile(fit.steps, (len(z), 1)), is_central=True)
        found = quadratic(slopes, z)
        return _Places(u, found.cost, found.gradient @ root, root.T @ found.normal @ root)

    return look


def _one_way(
    look: Callable[[np.ndarray], _Places], mode: _Places, direction: int, step: float
) -> list[_Places]:
    """Places from the mode on, by steps along the direction, until the ridge ends or is lost."""
    before, here, found = mode, mode, list[_Places]()
    least = mode.cost[0]
    for i in range(1, MOST_STEPS + 1):
        ahead = 2 * here.u - before.u
        ahead[:, direction] = i * step
        there, promised = _descended(look, ahead, direction)
        if not promised < LOST_NATS:
            break
        before, here = here, there
        found.append(there)
        least = min(least, there.cost[0])
        if there.cost[0] > least + FAINT_NATS:
            break
    return found


def _descended(
    look: Callable[[np.ndarray], _Places], u: np.ndarray, direction: int
) -> tuple[_Places, float]:
    """Where the others are best, from `u` on, and by how many nats they may still be better."""
    others = np.delete(np.arange(u.shape[1]), direction)
    best = look(u)
    move, promised = _step(best, others)
    for _ in range(DESCENDS):
        if promised < SETTLED_NATS:
            break
        ahead = best.u.copy()
        ahead[:, others] += move
        there = look(ahead)
        if there.cost[0] < best.cost[0]:
            best = there
            move, promised = _step(best, others)
        else:
            move = SHORTER * move
    return best, promised


def _step(here: _Places, others: np.ndarray) -> tuple[np.ndarray, float]:
    """The step of Gauss and Newton from a place, and how many nats it promises."""
    gradient = here.gradient[0, others]
    move = -np.linalg.solve(here.normal[0][np.ix_(others, others)], gradient)
    return move, -0.5 * float(gradient @ move)
