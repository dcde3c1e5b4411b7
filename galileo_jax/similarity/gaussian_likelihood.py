"""The Gaussian likelihood of measured positions, with the exact covariance.

    r = observed - predicted,     C = s^2 D + U U^T

D: the tracker's covariance of every frame (2 x 2 blocks); s: the noise scale; U: modes of
`discrepancy`. Among the modes is a wide offset for each object and axis, so that only
displacements count: for independent tracking errors that is the likelihood of the velocity
profile with its exact (tridiagonal) covariance, without losing the first frame's noise.
"""

from typing import Any, Literal, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Bool, Float

from galileo_jax.model.effects.effect import Surroundings
from galileo_jax.observation.observation import Observation
from galileo_jax.similarity.discrepancy import WANDER_SD_M, crossings, modes, offsets, wander
from galileo_jax.similarity.level_discrepancy import level_modes

NoiseModel = Literal["camera", "bodies", "tracker"]
FEW_VALUES = 400  # of so many a singular value decomposition takes a tenth of a second
LARGE = 6e5  # of patterns: its square times 2e-16 is a ten-thousandth
IDLE = 1e-3  # a gain that changes a residual by less than a millionth
Places = Float[jax.Array, "object axis frame"]
Scale = Float[jax.Array, ""] | float
Batch = Float[np.ndarray, "*batch object axis frame"]
Values = Float[np.ndarray, "*batch value"]


class Whitening(NamedTuple):
    """The covariance, decomposed once per clip.

    With D = L L^T and L^-1 U = Q diag(gain) V^T,
    C^-1/2 r = (y - Q (1 - s / sqrt(s^2 + gain^2)) Q^T y) / s,   y = L^-1 r.
    """

    observed_m: Float[np.ndarray, "object axis frame"]  # 0 where masked
    inverse_root: Float[np.ndarray, "object 2 2 frame"]  # L^-1, see `inverse_root_of`
    basis: Float[np.ndarray, "mode object axis frame"]  # orthonormal
    gain: Float[np.ndarray, " mode"]  # `[mode]`
    num_values: np.float64  # how many numbers were measured

    @property
    def rows(self) -> Any:
        """The basis as `[mode, value]`."""
        return self.basis.reshape(len(self.gain), -1)

    def whiten(self, difference_m: Places, noise_scale: Scale) -> Places:
        """C^-1/2 r for `difference_m` `[object, 2, frame]`; unit normal if the model is right."""
        y = jnp.einsum("oijt,ojt->oit", self.inverse_root, difference_m)
        amplitude = jnp.einsum("moit,oit->m", self.basis, y)
        shrink = 1 - noise_scale / jnp.sqrt(noise_scale**2 + self.gain**2)
        return (y - jnp.einsum("moit,m->oit", self.basis, shrink * amplitude)) / noise_scale

    def whiten_batch(self, difference_m: Batch, noise_scale: float) -> Values:
        """`whiten` of `[..., object, 2, frame]` in NumPy, nothing to compile: `[..., value]`."""
        left = noise_scale / np.sqrt(noise_scale**2 + self.gain**2)
        return self._with_modes_times(left, difference_m, noise_scale)

    def tracking_errors(self, difference_m: Batch, noise_scale: float) -> Values:
        """The tracking errors in a difference, in units of their sd: `[..., value]`.

        s L^T C^-1 r: what the modes take up is left out, and nothing else. The one residual that
        comparisons, pictures and chi2 per degree of freedom are made of; if the model is right
        the sum of its squares is `degrees` less what the parameters take up. `noise_scale`: in
        units of what the tracker states; 1 where residuals are shown.
        """
        left = noise_scale**2 / (noise_scale**2 + self.gain**2)
        return self._with_modes_times(left, difference_m, noise_scale)

    def _with_modes_times(
        self, left: np.ndarray, difference_m: Batch, noise_scale: float
    ) -> Values:
        """L^-1 r / s with the modes' parts times `left` `[mode]`."""
        # What a wild proposal makes of a motion may be infinite: it has no density, and is refused.
        with np.errstate(over="ignore", invalid="ignore"):
            y = np.einsum("oijt,...ojt->...oit", self.inverse_root, difference_m)
            y = y.reshape(*difference_m.shape[:-3], -1)
            return (y - ((y @ self.rows.T) * (1 - left)) @ self.rows) / noise_scale

    def log_density(self, predicted_m: Places, noise_scale: Scale) -> Float[jax.Array, ""]:
        """Log N(observed; predicted, C), up to the constant of the tracker's own covariance."""
        white = self.whiten(jnp.asarray(self.observed_m) - predicted_m, noise_scale)
        return -0.5 * (jnp.sum(white**2) + self.log_determinant(noise_scale))

    def degrees(self, noise_scale: Any) -> Any:
        """How many numbers tell of the tracker's noise: the measured less those the modes take."""
        return self.num_values - (self.gain**2 / (noise_scale**2 + self.gain**2)).sum()

    def absorbed(self, noise_scale: float) -> Float[np.ndarray, " value"]:
        """The share, 0 to 1, of each value's tracking error that the modes take up."""
        return (self.gain**2 / (noise_scale**2 + self.gain**2)) @ self.rows**2

    def information(self, noise_scale: Any) -> Any:
        """Fisher's, of the noise scale's logarithm."""
        share = noise_scale**2 / (noise_scale**2 + self.gain**2)
        return 2 * (self.num_values - len(self.gain) + (share**2).sum())

    def log_determinant(self, noise_scale: Any) -> Any:
        """Of the covariance, up to the constant of the tracker's own; NumPy's of NumPy's arrays."""
        gain = self.gain / noise_scale
        xp = gain.__array_namespace__()
        return self.num_values * xp.log(noise_scale**2) + xp.sum(xp.log1p(gain**2))


def whitening_in(
    observation: Observation, scene: Surroundings, noise: NoiseModel = "camera"
) -> Whitening:
    """The covariance of an observation in a scene, decomposed.

    `noise`: "camera": the tracker's errors and all of `discrepancy`; "bodies": without the camera's
    part of it; "tracker": the tracker's errors alone, to see what the rest is good for.
    """
    inverse_root = inverse_root_of(observation)
    patterns = white_patterns(fixed_patterns(observation, scene, noise), inverse_root)
    return whitening_of(observation, inverse_root, patterns)


def log_density_by_modes(left2: Any, along2: Any, noise_scale: Any, gain: Any, count: Any) -> Any:
    """`Whitening.log_density` of residuals y in the stated errors, from squares: NumPy's or JAX's.

        -1/2 (|y|^2 - sum a^2) / s^2 - 1/2 sum a^2 / (s^2 + g^2) - 1/2 log |C|,    a = Q^T y

    `left2`: `[...]`, |y|^2. `along2`: `[..., mode]`, a^2. `noise_scale`: `[...]`, s. `gain`: `[...,
    mode]`, g. `count`: how many numbers were measured.
    """
    xp, variance = along2.__array_namespace__(), noise_scale**2
    of_mode = variance[..., None]
    square = (left2 - along2.sum(-1)) / variance + (along2 / (of_mode + gain**2)).sum(-1)
    volume = count * xp.log(variance) + xp.log1p(gain**2 / of_mode).sum(-1)
    return -0.5 * (square + volume)


def inverse_root_of(observation: Observation) -> Float[np.ndarray, "object axis axis frame"]:
    """R with R^T R = C^-1 of the tracker's covariance C of each frame, 1/m; 0 where masked.

    L^-1 of C = L L^T. Of a place that is known along a unit vector e only, by sd s, the first row
    is e / s and the other 0: there is no second number, and none is fitted, counted or drawn.
    """
    mask, axes = observation.mask, observation.position_m.shape[1]
    covariance = np.moveaxis(observation.covariance_m2, -1, 1).copy()  # object frame 2 2
    covariance[~mask] = np.eye(axes)
    inverse_root = np.linalg.inv(np.linalg.cholesky(covariance)) * mask[..., None, None]
    across = observation.across
    is_line = (across != 0).any(axis=1)
    line = np.stack([-across[:, 1], across[:, 0]], axis=-1)[is_line]
    inverse_root[is_line] = 0.0
    inverse_root[is_line, 0, :2] = line / np.sqrt(observation.variance_m2[is_line])[:, None]
    return np.moveaxis(inverse_root, 1, -1)


def is_measured(
    inverse_root: Float[np.ndarray, "object axis axis frame"],
) -> Bool[np.ndarray, "object axis frame"]:
    """Which whitened numbers there are: none where nothing was seen, one of a place on a line."""
    return (inverse_root != 0).any(axis=2)


def white_patterns(
    patterns_m: Float[np.ndarray, "pattern object axis frame"],
    inverse_root: Float[np.ndarray, "object axis axis frame"],
) -> Float[np.ndarray, "pattern object axis frame"]:
    """Patterns in units of the tracker's stated errors; 0 where masked."""
    return np.einsum("oijt,mojt->moit", inverse_root, patterns_m)


def fixed_patterns(
    observation: Observation, scene: Surroundings, noise: NoiseModel
) -> Float[np.ndarray, "pattern object axis frame"]:
    """What is imperfect by a size that is known, `[pattern, object, axis, frame]`, m."""
    axes = observation.position_m.shape[1]
    if noise == "tracker":
        patterns = np.stack(offsets(observation))
    elif scene.is_level:
        patterns = level_modes(observation, scene, is_filmed=noise == "camera")
    elif axes == 3:
        size_m = WANDER_SD_M if observation.wander_m is None else observation.wander_m
        patterns = np.stack([*offsets(observation), *wander(observation, size_m)])
    else:
        patterns = modes(observation, scene, is_filmed=noise == "camera")
        patterns = np.concatenate([patterns, crossings(observation, scene)])
    if observation.modes_m is not None:
        patterns = np.concatenate([patterns, observation.modes_m])
    return patterns


def whitening_of(
    observation: Observation,
    inverse_root: Float[np.ndarray, "object axis axis frame"],
    patterns: Float[np.ndarray, "pattern object axis frame"],
) -> Whitening:
    """The covariance of the tracker's errors and of patterns in units of them, decomposed."""
    flat = patterns.reshape(len(patterns), -1)
    gain, basis = principal_modes(flat)
    gain, basis = gain[gain > IDLE], basis[gain > IDLE]  # many patterns are alike
    return Whitening(
        np.where(observation.mask[:, None], observation.position_m, 0.0),
        inverse_root,
        basis.reshape(len(gain), *patterns.shape[1:]),  # of short tracks fewer than patterns
        gain,
        np.float64(is_measured(inverse_root).sum()),
    )


def principal_modes(
    patterns: Float[np.ndarray, "pattern value"],
) -> tuple[Float[np.ndarray, " mode"], Float[np.ndarray, "mode value"]]:
    """The singular values and right singular vectors of patterns.

    Of more patterns than values, where these are many, from the eigenvalues of their covariance,
    which takes a quarter of the time; rounding adds less than a ten-thousandth of the tracker's
    variance to it. Where patterns are so large that it would add more, and of few values, by a
    singular value decomposition, which loses nothing.
    """
    num_patterns, num_values = patterns.shape
    is_long = num_patterns > num_values > FEW_VALUES
    size = float(np.linalg.norm(patterns))
    if is_long and size < LARGE:
        variance, basis = np.linalg.eigh(patterns.T @ patterns)
        variance[variance < np.finfo(float).eps * size**2] = 0.0  # rounding
        return np.sqrt(variance[::-1]), basis.T[::-1]
    _, gain, basis = np.linalg.svd(patterns, full_matrices=False)
    return gain, basis
