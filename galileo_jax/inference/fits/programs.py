"""Compiled programs of the gradient fit: whitened residuals, their slopes, damped steps.

None of them holds a rollout: motions come in as data. So JAX's cache keeps them between runs
whichever the engine, and clips share them: all that differs between clips is data, in shapes that
many clips have.
"""

from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
import optimistix as optx

from galileo_jax.inference.problem import seen
from galileo_jax.model.effects.effect import Surroundings
from galileo_jax.model.parameters import PriorTable
from galileo_jax.rollout.trajectory import Trajectory
from galileo_jax.runtime.trace_cache import kept
from galileo_jax.similarity.gaussian_likelihood import GaussianLikelihood, Whitening

FAILED = 1e6  # the whitened residual of a rollout that failed: worse than any that did not


class Kind(NamedTuple):
    """What programs are compiled for: hashable, the same for many clips."""

    effects: tuple
    names: tuple[str, ...]
    record_dt_s: float


class Padded(NamedTuple):
    """A clip's data in shapes that many clips share, so that they share compiled code.

    Attributes:
      times_s: `[frame]`.
      whitening: with masked frames and idle modes added.
    """

    times_s: np.ndarray
    whitening: Whitening


class ClipArrays(NamedTuple):
    """What compiled code needs of a clip, traced."""

    data: Padded
    scene: Surroundings
    priors: PriorTable
    absent: np.ndarray
    column: np.ndarray


def white_of(kind: Kind, theta, position, velocity, noise, data: Any, scene):
    """Whitened residuals of one motion, `[value]`."""
    times = jnp.arange(position.shape[-1]) * kind.record_dt_s
    # The drawn pitch is no measurement, so that none is made up here.
    motion = Trajectory(times, position, velocity, position[:, 0])
    predicted = seen(kind.effects, kind.names, theta, motion, data.times_s, scene)
    difference = data.whitening.observed_m - predicted
    white = GaussianLikelihood.whiten(difference, noise, data.whitening).reshape(-1)
    return jnp.where(jnp.abs(white) < FAILED, white, FAILED)


@kept(num_static=1)
def white_batch(kind: Kind, theta, position, velocity, noise, data, scene):
    """Whitened residuals of many motions, `[point, value]`."""
    return jax.vmap(lambda t, p, v, n: white_of(kind, t, p, v, n, data, scene))(
        theta, position, velocity, noise
    )


def _white_near(kind: Kind, u, z, free, index, noise, motion, clip: ClipArrays):
    """Residuals at z + u, with the motion linear in u `[free parameter]`; z of all clips."""
    moved = z.at[index].add(u, mode="drop")
    own = moved[clip.column]
    theta = jnp.where(free[clip.column], clip.priors.forward(own), clip.absent)
    position, velocity, position_slope, velocity_slope = motion
    position = position + jnp.tensordot(u, position_slope, axes=1)
    velocity = velocity + jnp.tensordot(u, velocity_slope, axes=1)
    return white_of(kind, theta, position, velocity, noise, clip.data, clip.scene)


@kept(num_static=1)
def jacobian_batch(kind: Kind, z, free, noise, index, p, v, dp, dv, clip):
    """Residuals `[point, value]` and their slopes `[point, value, free parameter]`."""

    def one(z, free, noise, index, *motion):
        def residuals(u):
            return _white_near(kind, u, z, free, index, noise, motion, clip)

        zero = jnp.zeros(index.shape[0])
        jacobian = jax.jacfwd(residuals)(zero)
        # A dummy entry of the index moves nothing; its column must not look like one that does.
        return residuals(zero), jnp.where(index < z.shape[0], jacobian, 0.0)

    return jax.vmap(one)(z, free, noise, index, p, v, dp, dv)


@kept(num_static=1)
def solve(kinds, dampings, size, z, free, noise, index, motions, clips):
    """The damped problems' solutions by Gauss-Newton, `[point, damping, model parameter]`."""
    solver = optx.GaussNewton(rtol=1e-3, atol=1e-3)

    def one(damping, size, z, free, noise, index, motions):
        here = jnp.where(index < z.shape[0], z.at[index].get(mode="fill", fill_value=0.0), 0.0)

        def objective(u, _):
            white = [
                _white_near(kind, u, z, free, index, noise[c], motion, clip)
                for c, (kind, motion, clip) in enumerate(zip(kinds, motions, clips, strict=True))
            ]
            return jnp.concatenate([*white, here + u, jnp.sqrt(damping) * size * u])

        start = jnp.zeros(index.shape[0])
        found = optx.least_squares(objective, solver, start, max_steps=8, throw=False).value
        return z.at[index].add(found, mode="drop")

    for_dampings = jax.vmap(one, (0, *[None] * 6))
    return jax.vmap(for_dampings, (None, *[0] * 6))(dampings, size, z, free, noise, index, motions)
