"""The posterior density as a compiled program that all clips share.

The data and the scene are its arguments.

`JointProblem.log_density` with the shapes of the gradient fit's programs (`fits/residuals.py`).
"""

from collections.abc import Callable
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from galileo_jax.inference.fits.fitted_clip import FittedClip
from galileo_jax.inference.fits.kernels import FAILED, ClipArrays, Kind, white_of
from galileo_jax.inference.joint_problem import NOISE_SD, JointProblem
from galileo_jax.inference.samplers.program import Program
from galileo_jax.inference.samplers.sampler import LogDensity
from galileo_jax.model.effects.effect import Effect
from galileo_jax.rollout.engine_jax import RECORDS
from galileo_jax.runtime.batching import rounded_up
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


class Part(NamedTuple):
    """A clip's data: `last_record` is the model's last, where rollouts end."""

    clip: ClipArrays
    last_record: np.ndarray


def density_of(trials: JointProblem) -> LogDensity:
    """`trials.log_density`: as a `Program` where the engine is written in JAX."""
    return _program_of(trials, log_density) or trials.log_density


def likelihood_of(trials: JointProblem) -> LogDensity:
    """The same without the prior, `[parameter] -> []`."""

    def without_prior(z: jax.Array) -> jax.Array:
        return trials.log_density(z) + 0.5 * jnp.sum(z**2)

    return _program_of(trials, log_likelihood) or without_prior


def log_density(parts: tuple[Rolled, ...], data: tuple[Part, ...], z: jax.Array) -> jax.Array:
    """The unnormalised posterior density; -inf where a rollout failed."""
    total = log_likelihood(parts, data, z) - 0.5 * jnp.sum(z**2)
    return jnp.where(jnp.isfinite(total), total, -jnp.inf)


def log_likelihood(parts: tuple[Rolled, ...], data: tuple[Part, ...], z: jax.Array) -> jax.Array:
    """Of all clips: parameters first, then each clip's noise scale."""
    noise = jnp.exp(NOISE_SD * z[-len(parts) :])
    each = zip(parts, data, noise, strict=True)
    return jnp.sum(jnp.stack([_of_clip(part, own, z, scale) for part, own, scale in each]))


def _of_clip(part: Rolled, data: Part, z: jax.Array, noise: jax.Array) -> jax.Array:
    clip, kind = data.clip, part.kind
    theta = clip.priors.forward(z[clip.column])
    position, velocity = part.roll_out(
        part.effects, part.names, part.num_records, kind.record_dt_s, theta, clip.scene
    )
    # As `padded_motion`: at rest beyond its end.
    is_over = jnp.arange(part.num_records) > data.last_record
    end = jnp.take(position, data.last_record, axis=-1)[..., None]
    position, velocity = jnp.where(is_over, end, position), jnp.where(is_over, 0.0, velocity)
    white = white_of(kind, theta, position, velocity, noise, clip.data, clip.scene)
    log_determinant = GaussianLikelihood.log_determinant(noise, clip.data.whitening)
    has_failed = jnp.any(jnp.abs(white) >= FAILED)
    return jnp.where(has_failed, -jnp.inf, -0.5 * (jnp.sum(white**2) + log_determinant))


def parts_of(trials: JointProblem) -> tuple[tuple[Rolled, ...], tuple[Part, ...]] | None:
    """What is compiled for, and data, clip by clip; None unless the engine is written in JAX."""
    rolled, data = [], []
    for index, problem in enumerate(trials.problems):
        roll_out = getattr(problem.engine, "roll_out", None)
        if roll_out is None:
            return None
        clip, model = FittedClip.of(trials, index), problem.model
        last, every = model.num_records, model.effects + model.nuisances
        long = rounded_up(last + 1, RECORDS)
        rolled.append(Rolled(roll_out, every, model.names, long, clip.kind))
        data.append(Part(clip.arrays, np.asarray(last)))
    return tuple(rolled), jax.tree.map(jnp.asarray, tuple(data))


def _program_of(trials: JointProblem, function: Callable[..., jax.Array]) -> Program | None:
    parts = parts_of(trials)
    if parts is None:
        return None
    rolled, data = parts
    return Program((function, rolled), data)
