"""A proposal along a ridge: where one direction of a posterior bends all the others.

Along its least determined directions a posterior may be a crescent. A drag, the power of the speed
that it grows with, and friction make up for each other over hundreds of the standard deviations of
what is known best, and not in proportion. No map of a few powers (`transport_map.py`) follows
that. But at each place along the way all the others are normal about where they are best:

    q(u) = q(a) t(others | best at a, covariance at a),    a = u along the direction

Both are found at knots and interpolated; q(a) is what Laplace's method gives for the others at a.

Source: H. Rue, S. Martino, N. Chopin, Approximate Bayesian inference for latent Gaussian models by
using integrated nested Laplace approximations, J. R. Stat. Soc. B 71 (2009), 319.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float
from scipy.special import logsumexp

from galileo_jax.inference.fits.kernels import Quadratic
from galileo_jax.inference.fits.laplace import GradientFit
from galileo_jax.inference.fits.residuals import Residuals, quadratic
from galileo_jax.inference.fits.t_proposal import Points, Values, log_student_t, student_t
from galileo_jax.inference.fits.transport_map import Valley
from galileo_jax.numerics.normal_matrix import symmetric_root

BENT = 3.0  # standard deviations of a stiffer direction, one along a direction: a map follows less
STEP, MOST_STEPS = 0.5, 10  # standard deviations along the way; to each side
DESCENDS = 10  # steps of Gauss and Newton at a knot, at most
SHORTER = 0.25  # a step that leads uphill
SETTLED_NATS = 0.05  # that a further step promises: a place is found
LOST_NATS = 0.5  # where these are still promised, the ridge was lost
FAINT_NATS = 10.0  # below the best: there the ridge ends
CELLS = 256
FLATTER = 0.8  # power of q(a): what draws must be wider than what is drawn

Look = Callable[[np.ndarray], Quadratic]
"""The misfit round places u `[place, direction]`, in u."""


@dataclass(frozen=True)
class Ridge:
    """The proposal, in straight coordinates u with `z = mode + R u` (`Valley.root`)."""

    valley: Valley  # whose mode and R these are
    direction: int  # the column of R that the way goes along
    knots: Float[np.ndarray, " knot"]  # a, ascending
    best: Callable[[np.ndarray], np.ndarray]  # of a, the others, `[point, other]`
    root: Float[np.ndarray, "knot other other"]  # the symmetric root of the others' precision
    edges: Float[np.ndarray, " edge"]  # of a
    log_share: Float[np.ndarray, " cell"]  # of q(a), in a cell

    def draw(self, generator: np.random.Generator, num: int) -> tuple[Points, Values]:
        """See `Proposal`."""
        cell = generator.choice(len(self.log_share), num, p=np.exp(self.log_share))
        a = self.edges[cell] + np.diff(self.edges)[cell] * generator.random(num)
        t = student_t(generator, num, len(self.valley.axes)) @ self.valley.axes
        t = np.delete(t, self.direction, axis=1)
        others = self.best(a) + np.linalg.solve(self._root_at(a), t[..., None])[..., 0]
        z = self.valley.mode + np.insert(others, self.direction, a, axis=1) @ self.valley.root.T
        return z, self.log_density(z)

    def log_density(self, z: Points) -> Values:
        """See `Proposal`; -inf beyond the ends of the ridge."""
        u = self.valley.along(z)
        a, others = u[:, self.direction], np.delete(u, self.direction, axis=1)
        cell = np.searchsorted(self.edges, a) - 1
        is_inside = (cell >= 0) & (cell < len(self.log_share))
        cell, a = np.where(is_inside, cell, 0), np.where(is_inside, a, self.edges[0])
        root = self._root_at(a)
        with np.errstate(over="ignore", invalid="ignore"):  # far off, where it draws none
            t = np.einsum("pij,pj->pi", root, others - self.best(a))
        along = self.log_share[cell] - np.log(np.diff(self.edges)[cell])
        volume = np.linalg.slogdet(root)[1] - self.valley.log_volume
        return np.where(is_inside, along + log_student_t(t) + volume, -np.inf)

    def _root_at(self, a: np.ndarray) -> np.ndarray:
        """Between knots in proportion, `[point, other, other]`."""
        after = np.clip(np.searchsorted(self.knots, a), 1, len(self.knots) - 1)
        low, high = self.knots[after - 1], self.knots[after]
        share = ((a - low) / (high - low))[:, None, None]
        return (1 - share) * self.root[after - 1] + share * self.root[after]


def ridge_along(fit: GradientFit, valley: Valley, residuals: Residuals) -> Ridge | None:
    """The ridge through a fit; None where the map follows it, or it is lost to either side.

    `valley`: round it.
    """
    bends = np.abs(valley.quadratic).max(axis=0)
    if bends.max() <= BENT:
        return None
    from scipy.interpolate import CubicSpline  # most fits never come here

    direction, count = int(bends.argmax()), len(fit.steps)
    num_noise = len(fit.z) - count
    size = valley.root.shape[1] - num_noise
    root = valley.root[:count, :size]

    def look(u: np.ndarray) -> Quadratic:
        z = fit.z[:count] + u @ root.T
        steps = np.tile(fit.steps, (len(z), 1))
        slopes = residuals.slopes(fit.points(z), steps, sides="open")
        found = quadratic(slopes, z)
        return Quadratic(u, found.cost, found.gradient @ root, root.T @ found.normal @ root)

    known = [look(np.zeros((1, size)))]
    for side in (STEP, -STEP):
        known += _one_way(look, known[0], direction, side)
    if len(known) < 3:
        return None
    known.sort(key=lambda place: place.z[0, direction])
    u, cost, _, normal = (np.concatenate(values) for values in zip(*known, strict=True))
    others = np.delete(np.arange(size), direction)
    precision = symmetric_root(normal[:, others[:, None], others])
    knots, edges = u[:, direction], np.linspace(u[0, direction], u[-1, direction], CELLS + 1)
    log_q = -cost - np.linalg.slogdet(precision)[1]
    log_share = FLATTER * np.interp((edges[1:] + edges[:-1]) / 2, knots, log_q)
    # Noise scales, behind the others, hardly depend on these.
    whole = np.tile(np.eye(size - 1 + num_noise), (len(knots), 1, 1))
    whole[:, : size - 1, : size - 1] = precision
    best = CubicSpline(knots, np.pad(u[:, others], ((0, 0), (0, num_noise))))
    return Ridge(valley, direction, knots, best, whole, edges, log_share - logsumexp(log_share))


def _one_way(look: Look, mode: Quadratic, direction: int, step: float) -> list[Quadratic]:
    """Places from the mode on, by steps along the direction, until the ridge ends or is lost."""
    before, here, found = mode, mode, list[Quadratic]()
    least = mode.cost[0]
    for i in range(1, MOST_STEPS + 1):
        ahead = 2 * here.z - before.z
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


def _descended(look: Look, u: np.ndarray, direction: int) -> tuple[Quadratic, float]:
    """Where the others are best, from `u` on, and by how many nats they may still be better."""
    others = np.delete(np.arange(u.shape[1]), direction)

    def step(here: Quadratic) -> tuple[np.ndarray, float]:
        gradient = here.gradient[0, others]
        move = -np.linalg.solve(here.normal[0][np.ix_(others, others)], gradient)
        return move, -0.5 * float(gradient @ move)

    best = look(u)
    move, promised = step(best)
    for _ in range(DESCENDS):
        if promised < SETTLED_NATS:
            break
        ahead = best.z.copy()
        ahead[:, others] += move
        there = look(ahead)
        if there.cost[0] < best.cost[0]:
            best = there
            move, promised = step(best)
        else:
            move = SHORTER * move
    return best, promised
