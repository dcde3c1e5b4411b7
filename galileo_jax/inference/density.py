"""The posterior density as a compiled program that all clips share.

The data and the scene are its arguments.

`JointProblem.log_density` with the shapes of the gradient fit's programs (`fits/residuals.py`).
"""

from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from galileo_jax.inference.fits.fitted_clip import FittedClip
from galileo_jax.inference.fits.kernels import FAILED, ClipArrays, Kind, left_of, white_of
from galileo_jax.inference.fits.laplace import GradientFit
from galileo_jax.inference.fits.sized_density import LEAST_SIZES, sizes_of
from galileo_jax.inference.joint_problem import NOISE_SD, JointProblem
from galileo_jax.inference.samplers.program import Program
from galileo_jax.inference.samplers.sampler import LogDensity
from galileo_jax.model.effects.effect import Effect
from galileo_jax.rollout.engine_jax import RECORDS
from galileo_jax.runtime.batching import FRAMES, rounded_up
from galileo_jax.similarity.gaussian_likelihood import GaussianLikelihood


class Rolled(NamedTuple):
    """What a clip's part is compiled for.

    Attributes:
      roll_out: of its engine.
      effects: all that move things.
      names: of its parameters.
      num_records: of a rollout, rounded up.
      kind: of what is seen of a motion.
    """

    roll_out: Callable[..., Any]
    effects: tuple[Effect, ...]
    names: tuple[str, ...]
    num_records: int
    kind: Kind


class Sized(NamedTuple):
    """Covariances with imperfections of several sizes, C_k = s^2 D + L B^T V_k^T g_k^2 V_k B L^T.

    Attributes:
      basis: B `[mode, value]`, orthonormal rows, in the stated errors.
      turned: V_k `[size, mode, mode]`, orthonormal rows, or 0.
      gain: g_k `[size, mode]`.
    """

    basis: np.ndarray
    turned: np.ndarray
    gain: np.ndarray


class Part(NamedTuple):
    """A clip's data: `last_record` is the model's last, where rollouts end; `sized` or None."""

    clip: ClipArrays
    last_record: np.ndarray
    sized: Sized | None


class Data(NamedTuple):
    """All clips' data, and log p(y | sizes) of each of the sizes `[size]`; None without."""

    parts: tuple[Part, ...]
    of_sizes: np.ndarray | None


def density_of(trials: JointProblem, fit: GradientFit | None = None) -> LogDensity:
    """`trials.log_density`: as a `Program` where the engine is written in JAX.

    Sizes of imperfections of a fit are then integrated, as in `fits/sized_density.py`: its draws of
    them are alike a posteriori, so that p(z | y) is the mean of p(y | z, x) p(z) / p(y | x).
    """
    parts = parts_of(trials, fit if fit is not None and fit.sizes is not None else None)
    return trials.log_density if parts is None else Program((log_density, parts[0]), parts[1])


def log_density(parts: tuple[Rolled, ...], data: Data, z: jax.Array) -> jax.Array:
    """The unnormalised posterior density; -inf where a rollout failed."""
    noise = jnp.exp(NOISE_SD * z[-len(parts) :])
    each = zip(parts, data.parts, noise, strict=True)
    found = jnp.sum(jnp.stack([_of_clip(part, own, z, scale) for part, own, scale in each]), axis=0)
    if data.of_sizes is not None:
        found = jax.nn.logsumexp(found - data.of_sizes) - jnp.log(len(data.of_sizes))
    total = found - 0.5 * jnp.sum(z**2)
    return jnp.where(jnp.isfinite(total), total, -jnp.inf)


def _of_clip(part: Rolled, data: Part, z: jax.Array, noise: jax.Array) -> jax.Array:
    """The log likelihood of a clip; with several sizes `[size]`."""
    clip, kind = data.clip, part.kind
    theta = clip.priors.forward(z[clip.column])
    position, velocity = part.roll_out(
        part.effects, part.names, part.num_records, kind.record_dt_s, theta, clip.scene
    )
    # As `padded_motion`: at rest beyond its end.
    is_over = jnp.arange(part.num_records) > data.last_record
    end = jnp.take(position, data.last_record, axis=-1)[..., None]
    position, velocity = jnp.where(is_over, end, position), jnp.where(is_over, 0.0, velocity)
    whitening = clip.data.whitening
    if data.sized is not None:
        left = left_of(kind, theta, position, velocity, clip.data, clip.scene)
        along2 = jnp.einsum("kmn,n->km", data.sized.turned, data.sized.basis @ left) ** 2
        found = GaussianLikelihood.log_density_by_modes(
            jnp.sum(left**2), along2, noise, data.sized.gain, whitening.num_values
        )
        return jnp.where(jnp.any(jnp.abs(left) >= FAILED), -jnp.inf, found)
    white = white_of(kind, theta, position, velocity, noise, clip.data, clip.scene)
    log_determinant = GaussianLikelihood.log_determinant(noise, whitening)
    has_failed = jnp.any(jnp.abs(white) >= FAILED)
    return jnp.where(has_failed, -jnp.inf, -0.5 * (jnp.sum(white**2) + log_determinant))


def parts_of(
    trials: JointProblem, fit: GradientFit | None = None
) -> tuple[tuple[Rolled, ...], Data] | None:
    """What is compiled for, and data, clip by clip; None unless the engine is written in JAX.

    Args:
      trials: the clips.
      fit: of them, with sizes, over which is integrated.
    """
    if any(not hasattr(problem.engine, "roll_out") for problem in trials.problems):
        return None
    draws, of_sizes = ([], None) if fit is None else sizes_of(trials, fit, LEAST_SIZES)
    rolled, data = [], []
    for index, problem in enumerate(trials.problems):
        clip, model = FittedClip.of(trials, index), problem.model
        last, every = model.num_records, model.effects + model.nuisances
        long = rounded_up(last + 1, RECORDS)
        roll_out = problem.engine.roll_out  # pyright: ignore
        rolled.append(Rolled(roll_out, every, model.names, long, clip.kind))
        data.append(Part(clip.arrays, np.asarray(last), _sized(clip, draws) if draws else None))
    return tuple(rolled), jax.tree.map(jnp.asarray, Data(tuple(data), of_sizes))


def _sized(clip: FittedClip, draws: Sequence[Mapping[str, float]]) -> Sized:
    """The covariances of a clip with imperfections of each of several sizes, padded as it is."""
    largest = {name: max(one[name] for one in draws) for name in draws[0]}
    whole = clip.problem.with_sizes(largest).data
    basis = whole.basis.reshape(len(whole.gain), -1)
    count = rounded_up(len(basis), FRAMES)
    turned, gain = np.zeros((len(draws), count, count)), np.zeros((len(draws), count))
    for k, sizes in enumerate(draws):
        data = clip.problem.with_sizes(sizes).data
        patterns = data.gain[:, None] * data.basis.reshape(len(data.gain), -1)
        _, own, vectors = np.linalg.svd(patterns @ basis.T, full_matrices=False)
        turned[k, : len(own), : len(basis)], gain[k, : len(own)] = vectors, own
    frames = clip.data.whitening.observed_m.shape[-1] - whole.basis.shape[-1]
    padded = np.pad(whole.basis, [(0, count - len(basis)), (0, 0), (0, 0), (0, frames)])
    return Sized(padded.reshape(count, -1), turned, gain)
