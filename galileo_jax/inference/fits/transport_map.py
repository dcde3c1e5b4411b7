"""Coordinates in which a curved valley of the posterior is straight.

    z = mode + R (u + B u^2 + C u^3),  u = V^T w      R R^T the covariance; B, C strictly
                                                      lower triangular; V orthogonal

The columns of R are the eigenvectors V of the covariance, each times its standard deviation, least
determined direction first. Along such a direction the well-determined ones shift by several of
their own standard deviations (for example if object 2 hardly slides). A normal proposal with any
covariance is then almost always rejected. B and C describe this shift. Each direction shifts only
better-determined ones, so the map is invertible and its determinant constant: the densities of w
and z differ by a constant factor.

Random numbers are drawn for w, not for u. An eigenvector has no sign, and those of equal
eigenvalues (two parameters that do not show) are any basis of their plane; which ones come out
depends on the processor's rounding. The map from w has the symmetric root V D^1/2 V^T in the place
of R and does not depend on that choice.

How far a direction must be moved follows from the misfit's slopes G (in u, with the mode's
Jacobian) where another, j, is moved by h = 2 standard deviations, two rollouts each:

    B_ij = -(G_i(h e_j) + G_i(-h e_j) - 2 G_i(0)) / 2 h^2
    C_ij = -(G_i(h e_j) - G_i(-h e_j)) / 2 h^3

B is the geodesic acceleration of M. K. Transtrum, J. P. Sethna, Improvements to the
Levenberg-Marquardt algorithm, arXiv 1201.5885, over a finite step. Chains in such coordinates:
M. D. Parno, Y. M. Marzouk, Transport map accelerated Markov chain Monte Carlo, SIAM/ASA J.
Uncertain. Quantif. 6 (2018), 10.1137/17M1134640.
"""

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from galileo_jax.inference.fits.kernels import FAILED
from galileo_jax.inference.fits.laplace import GradientFit
from galileo_jax.inference.fits.residuals import Batch, Residuals
from galileo_jax.inference.joint_problem import NOISE_SD

if TYPE_CHECKING:  # these need Equinox, and a gradient fit does not
    from galileo_jax.inference.samplers.sampler import LogDensity

REACH = 2.0  # standard deviations: what proposals mostly keep within
LEAST_VARIANCE = 1e-18  # in z: where slopes are absurd, rounding leaves some below 0
EVERY = slice(None)
NUM_SCATTERED = 64  # that starts are chosen from


@jax.tree_util.register_dataclass
@dataclass(frozen=True)
class Valley:
    """The map from `w`, in which the posterior is about N(0, 1), to `z`.

    Attributes:
      mode: `[parameter]`, z at w = 0.
      root: `[parameter, direction]`, R; pinned parameters have no direction.
      axes: `[direction, direction]`, V: w in terms of u.
      quadratic: `[direction, direction]`, B.
      cubic: `[direction, direction]`, C.
    """

    mode: Any
    root: Any
    axes: Any
    quadratic: Any
    cubic: Any

    def __call__(self, w: Any) -> Any:
        """From w to z, `[..., parameter]`; in NumPy or JAX, whichever w is of."""
        u = w @ self.axes
        return self.mode + (u + u**2 @ self.quadratic.T + u**3 @ self.cubic.T) @ self.root.T

    def straight(self, z: np.ndarray, free: np.ndarray | slice = EVERY) -> np.ndarray:
        """W of z, `[point, direction]`, if there were no bend.

        Args:
          z: `[point, parameter]`.
          free: `[parameter]`, those that have directions, if not all.
        """
        return self._along_directions(z, free) @ self.axes.T

    def inverse(self, z: np.ndarray, free: np.ndarray) -> np.ndarray:
        """W of z, `[point, direction]`; arguments as of `straight`."""
        u = self._along_directions(z, free)
        for i in range(1, u.shape[1]):
            u[:, i] -= u[:, :i] ** 2 @ self.quadratic[i, :i] + u[:, :i] ** 3 @ self.cubic[i, :i]
        return u @ self.axes.T

    def _along_directions(self, z: np.ndarray, free: np.ndarray | slice) -> np.ndarray:
        """R^-1 (z - mode), `[point, direction]`: standard deviations along each direction."""
        return np.linalg.solve(self.root[free], (z - self.mode)[:, free].T).T

    @property
    def log_volume(self) -> float:
        """Log of what a unit of w is in z, which is the same everywhere."""
        return float(np.sum(np.log(np.linalg.svd(self.root, compute_uv=False))))


class Coordinates(NamedTuple):
    """Coordinates w for chains, and what a density looks like in them.

    Attributes:
      valley: from w to z.
      mean: `[parameter]`, of w.
      covariance: `[parameter, parameter]`, of w.
    """

    valley: Valley
    mean: np.ndarray
    covariance: np.ndarray


def along(log_density: "LogDensity", valley: Valley) -> "LogDensity":
    """A log density of z as one of w."""
    from galileo_jax.inference.samplers.program import Program

    if isinstance(log_density, Program):
        arrays = (jax.tree.map(jnp.asarray, valley), log_density.arrays)
        return Program((_program_along, log_density.code), arrays)
    return lambda w: log_density(valley(w))


def _program_along(code: tuple, arrays: tuple[Valley, Any], w: jax.Array) -> jax.Array:
    from galileo_jax.inference.samplers.program import Program

    valley, rest = arrays
    return Program(code, rest)(valley(w))


def valley_round(fit: GradientFit, residuals: Residuals) -> Valley:
    """The coordinates round a fit: their bends take two rollouts per parameter.

    Args:
      fit: the mode, with slopes at `fit.steps`.
      residuals: of the trials that were fitted.
    """
    count, own = len(fit.steps), np.flatnonzero(fit.free[: len(fit.steps)])
    size, directions = len(own), len(fit.z) - count + len(own)
    root, axes = np.zeros((len(fit.z), directions)), np.eye(directions)
    quadratic, cubic = np.zeros((directions, directions)), np.zeros((directions, directions))
    variance, vectors = np.linalg.eigh(fit.covariance[np.ix_(own, own)])
    for vector in vectors.T:  # a ridge is followed by the sign, too
        vector *= np.sign(vector[np.abs(vector).argmax()])
    axes[:size, :size] = vectors[:, ::-1]
    root[own, :size] = axes[:size, :size] * np.sqrt(np.maximum(variance, LEAST_VARIANCE))[::-1]
    # Noise scales, behind the others, hardly depend on these.
    root[count:, size:] = np.diag(np.sqrt(np.diag(fit.covariance)[count:]))
    slopes = residuals.slopes(_near(fit, fit.z[None]), fit.steps[None], is_central=True)
    jacobian = np.concatenate([slopes.among_all(clip, axis=2)[0] for clip in slopes.jacobian])
    step = REACH * np.eye(size)
    z = np.tile(fit.z, (1 + 2 * size, 1))
    z += np.concatenate([np.zeros((1, size)), step, -step]) @ root[:, :size].T
    white = np.concatenate(residuals.whites(_near(fit, z)), axis=1)
    white[np.abs(white).max(axis=1) >= FAILED] = np.nan
    gradient = white @ (jacobian @ root[:count, :size]) + z[:, :count] @ root[:count, :size]
    ahead, behind = gradient[1:].reshape(2, size, size) - gradient[0]
    quadratic[:size, :size] = _stiffer(-(ahead + behind) / (2 * REACH**2))
    cubic[:size, :size] = _stiffer(-(ahead - behind) / (2 * REACH**3))
    return Valley(fit.z, root, axes, quadratic, cubic)


def learned(valley: Valley, w: np.ndarray) -> Coordinates:
    """Coordinates that suit draws, and the draws' mean and covariance in them.

    The valley's own; or straight ones, if in these a normal density comes closer to the draws: a
    fit whose widths are wrong, at a kink of the misfit, has wrong bends, too. The determinants are
    constant, so that those of the covariances compare.

    Args:
      valley: in whose coordinates the draws were made.
      w: `[draw, parameter]`.
    """
    z = valley(w)
    bent, straight = np.cov(w, rowvar=False), np.cov(z, rowvar=False)
    size = np.linalg.slogdet(bent)[1] + 2 * valley.log_volume
    if size <= np.linalg.slogdet(straight)[1]:
        return Coordinates(valley, w.mean(axis=0), bent)
    dim = len(straight)
    none = np.zeros((dim, dim))
    axes = np.eye(dim)
    unbent = Valley(z.mean(axis=0), np.linalg.cholesky(straight), axes, none, none)
    return Coordinates(unbent, np.zeros(dim), axes)


def scattered(
    valley: Valley, fit: GradientFit, residuals: Residuals, seed: int, num: int
) -> np.ndarray:
    """Starts for chains, `[chain, parameter]`, in w; wider than the posterior, as R-hat asks.

    Drawn from the density to the power 1/2, by importance from N(0, 2): where the map leads
    astray, far off, none is left.
    """
    size = int(np.sum(fit.free[: len(fit.steps)]))
    generator = np.random.default_rng([seed, 10])
    w = np.sqrt(2) * generator.standard_normal((max(NUM_SCATTERED, num), valley.root.shape[1]))
    points = _near(fit, valley(w))
    surplus = 0.25 * np.sum(w[:, :size] ** 2, axis=1) - 0.5 * residuals.costs(points)
    # The largest of log-weights with Gumbel noise: a draw without replacement.
    return w[np.argsort(-(surplus + generator.gumbel(size=len(w))))[:num]]


def _stiffer(moved: np.ndarray) -> np.ndarray:
    """`[direction that bends, direction bent]` transposed, of those that bend stiffer ones.

    None is led where a rollout fails.
    """
    return np.tril(np.where(np.isfinite(moved.T), moved.T, 0.0), -1)


def _near(fit: GradientFit, z: np.ndarray) -> Batch:
    """Points with the fit's noise."""
    count = len(fit.steps)
    noise = np.exp(NOISE_SD * fit.z[count:])
    free = np.broadcast_to(fit.free[:count], (len(z), count))
    return Batch(z[:, :count], free, np.tile(noise, (len(z), 1)))
