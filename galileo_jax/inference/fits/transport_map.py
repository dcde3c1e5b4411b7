"""Coordinates in which a curved valley of the posterior is straight.

    z = mode + R (u + B u^2 + C u^3),  u = V^T w      R R^T the covariance; B, C strictly
                                                      lower triangular; V orthogonal

The columns of R are the eigenvectors V of the covariance, each times its standard deviation D,
least determined direction first. Along such a direction the well-determined ones shift by several
of their own standard deviations (for example if object 2 hardly slides). A normal proposal with any
covariance is then almost always rejected. B and C describe this shift. Each direction shifts only
better-determined ones, so the map is invertible and its determinant constant: the densities of w
and z differ by a constant factor.

Random numbers are drawn for w, not for u. An eigenvector has no sign, and those of equal
eigenvalues (two parameters that do not show) are any basis of their plane; which ones come out
depends on the processor's rounding. The map from w has the symmetric root V D V^T in the place of R
and does not depend on that choice; but B and C do, of two parameters of which one shows where it is
moved far. So S covariance S is taken, S diagonal, with entries up to `SPLIT` apart, whose
eigenvalues differ, and R = S^-1 V D: R R^T is the covariance all the same.

How far a direction must be moved follows from the misfit's slopes G (in u, with the mode's
Jacobian) where another, j, is moved by h = 2 standard deviations, two rollouts each:

    B_ij = -(G_i(h e_j) + G_i(-h e_j) - 2 G_i(0)) / 2 h^2
    C_ij = -(G_i(h e_j) - G_i(-h e_j)) / 2 h^3

B is the geodesic acceleration of M. K. Transtrum, J. P. Sethna, Improvements to the
Levenberg-Marquardt algorithm, arXiv 1201.5885, over a finite step. Chains in such coordinates:
M. D. Parno, Y. M. Marzouk, Transport map accelerated Markov chain Monte Carlo, SIAM/ASA J.
Uncertain. Quantif. 6 (2018), 10.1137/17M1134640.
"""

from dataclasses import dataclass, replace
from typing import Any

import jax
import numpy as np

from galileo_jax.inference.fits.kernels import FAILED
from galileo_jax.inference.fits.laplace import GradientFit
from galileo_jax.inference.fits.residuals import Residuals
from galileo_jax.inference.fits.t_proposal import Points, Values, log_student_t, student_t

REACH = 2.0  # standard deviations: what proposals mostly keep within
SPLIT = 0.01  # by how much the scale of the last parameter differs from the first's
LEAST_VARIANCE = 1e-18  # in z: where slopes are absurd, rounding leaves some below 0


@jax.tree_util.register_dataclass
@dataclass(frozen=True)
class Valley:
    """The map from `w`, in which the posterior is about N(0, 1), to `z`; a proposal, a t in w."""

    mode: Any  # `[parameter]`, z at w = 0
    root: Any  # `[parameter, direction]`, R; pinned parameters have no direction
    axes: Any  # `[direction, direction]`, V: w in terms of u
    quadratic: Any  # `[direction, direction]`, B
    cubic: Any  # `[direction, direction]`, C

    def __call__(self, w: Any) -> Any:
        """From w to z, `[..., parameter]`; in NumPy or JAX, whichever w is of."""
        u = w @ self.axes
        return self.mode + (u + u**2 @ self.quadratic.T + u**3 @ self.cubic.T) @ self.root.T

    @property
    def unbent(self) -> "Valley":
        """The same with B and C 0."""
        return replace(self, quadratic=0 * self.quadratic, cubic=0 * self.cubic)

    def along(self, z: Points) -> np.ndarray:
        """R^-1 (z - mode), `[point, direction]`: standard deviations along each direction."""
        own = self.root.any(axis=1)
        return np.linalg.solve(self.root[own], (z - self.mode)[:, own].T).T

    def straight(self, z: Points) -> np.ndarray:
        """W of z, `[point, direction]`, if there were no bend."""
        return self.along(z) @ self.axes.T

    def inverse(self, z: Points) -> np.ndarray:
        """W of z, `[point, direction]`."""
        u = self.along(z).T.copy()  # rows of points, which are many, one after the other
        for i, own in enumerate(u[:-1]):
            later, square = slice(i + 1, None), own * own
            u[later] -= np.outer(self.quadratic[later, i], square)
            u[later] -= np.outer(self.cubic[later, i], square * own)
        return u.T @ self.axes.T

    @property
    def log_volume(self) -> float:
        """Log of what a unit of w is in z, which is the same everywhere."""
        return float(np.sum(np.log(np.linalg.svd(self.root, compute_uv=False))))

    def draw(self, generator: np.random.Generator, num: int) -> tuple[Points, Values]:
        """See `Proposal`."""
        w = student_t(generator, num, self.root.shape[1])
        return self(w), log_student_t(w) - self.log_volume

    def log_density(self, z: Points) -> Values:
        """See `Proposal`."""
        with np.errstate(over="ignore", invalid="ignore"):  # far off, where it draws none
            w = self.inverse(z)
        return log_student_t(w) - self.log_volume


def valley_round(fit: GradientFit, residuals: Residuals) -> Valley:
    """The coordinates round a fit: their bends take two rollouts per parameter.

    `fit`: the mode, with slopes at `fit.steps`.
    """
    count, own = len(fit.steps), np.flatnonzero(fit.free[: len(fit.steps)])
    size, directions = len(own), len(fit.z) - count + len(own)
    root, axes = np.zeros((len(fit.z), directions)), np.eye(directions)
    quadratic, cubic = np.zeros((directions, directions)), np.zeros((directions, directions))
    scale = 1 + SPLIT * np.arange(size) / size
    variance, vectors = np.linalg.eigh(scale[:, None] * fit.covariance[np.ix_(own, own)] * scale)
    for vector in vectors.T:  # a ridge is followed by the sign, too
        vector *= np.sign(vector[np.abs(vector).argmax()])
    axes[:size, :size] = vectors[:, ::-1]
    sd = np.sqrt(np.maximum(variance, LEAST_VARIANCE))[::-1]
    root[own, :size] = axes[:size, :size] * sd / scale[:, None]
    # Noise scales, behind the others, hardly depend on these.
    root[count:, size:] = np.diag(np.sqrt(np.diag(fit.covariance)[count:]))
    slopes = residuals.slopes(fit.points(fit.z[None]), fit.steps[None], sides="open")
    jacobian = np.concatenate([slopes.among_all(clip, axis=2)[0] for clip in slopes.jacobian])
    step = REACH * np.eye(size)
    z = np.tile(fit.z, (1 + 2 * size, 1))
    z += np.concatenate([np.zeros((1, size)), step, -step]) @ root[:, :size].T
    white = np.concatenate(residuals.whites(fit.points(z)), axis=1)
    white[np.abs(white).max(axis=1) >= FAILED] = np.nan
    gradient = white @ (jacobian @ root[:count, :size]) + z[:, :count] @ root[:count, :size]
    ahead, behind = gradient[1:].reshape(2, size, size) - gradient[0]
    quadratic[:size, :size] = _stiffer(-(ahead + behind) / (2 * REACH**2))
    cubic[:size, :size] = _stiffer(-(ahead - behind) / (2 * REACH**3))
    return Valley(fit.z, root, axes, quadratic, cubic)


def _stiffer(moved: np.ndarray) -> np.ndarray:
    """`[direction that bends, direction bent]` transposed, of those that bend stiffer ones.

    None is led where a rollout fails.
    """
    return np.tril(np.where(np.isfinite(moved.T), moved.T, 0.0), -1)
