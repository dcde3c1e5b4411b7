"""Compiled programs of the gradient fit: whitened residuals, their slopes, damped steps.

None of them holds a rollout: motions come in as data. So JAX's cache keeps them between runs
whichever the engine, and clips share them: all that differs between clips is data, in shapes that
many clips have.
"""

from typing import Any, NamedTuple

import jax
import jax.numpy as jnp

from galileo_jax.inference.problem import Kind, seen
from galileo_jax.model.effects.effect import Surroundings
from galileo_jax.runtime.trace_cache import trace_cached
from galileo_jax.similarity.gaussian_likelihood import Whitening

# Damping is lowered where a step brought three quarters of what it promised: the textbook's value
# (Nocedal and Wright, 2006, ch. 4). optimistix's own, 0.99, crawls in a curved valley.
HIGH_CUTOFF = 0.75
FAILED = 1e6  # the whitened residual of a rollout that failed: worse than any that did not


class Quadratic(NamedTuple):
    """A cost and its Gauss-Newton approximation, of each of several points."""

    z: Any  # `[point, model parameter]`
    cost: Any  # `[point]`, nats
    gradient: Any  # `[point, model parameter]`
    normal: Any  # `[point, model parameter, model parameter]`, J^T J + 1


class ClipArrays(NamedTuple):
    """What compiled code needs of a clip, in shapes that many clips share."""

    times_s: Any  # `[frame]`
    whitening: Whitening  # with masked frames and idle modes added
    scene: Surroundings  # what it shows


def left_of(kind: Kind, theta, position, velocity, clip: ClipArrays):
    """Residuals of one motion in units of the stated errors, `[value]`."""
    difference = _difference_m(kind, theta, position, velocity, clip)
    left = jnp.einsum("oijt,ojt->oit", clip.whitening.inverse_root, difference).reshape(-1)
    return jnp.where(jnp.abs(left) < FAILED, left, FAILED)


def white_of(kind: Kind, theta, position, velocity, noise, clip: ClipArrays):
    """Whitened residuals of one motion, `[value]`."""
    difference = _difference_m(kind, theta, position, velocity, clip)
    white = clip.whitening.whiten(difference, noise).reshape(-1)
    return jnp.where(jnp.abs(white) < FAILED, white, FAILED)


def _difference_m(kind: Kind, theta, position, velocity, clip: ClipArrays) -> Any:
    """Observed minus predicted, `[object, axis, frame]`."""
    predicted = seen(kind, theta, position, velocity, clip.times_s, clip.scene)
    return clip.whitening.observed_m - predicted


@trace_cached(num_static=1)
def white_batch(kind: Kind, theta, position, velocity, noise, clip: ClipArrays):
    """Whitened residuals of many motions, `[point, value]`."""
    return jax.vmap(lambda t, p, v, n: white_of(kind, t, p, v, n, clip))(
        theta, position, velocity, noise
    )


@trace_cached(num_static=1)
def seen_slopes_batch(kind: Kind, theta, index, noise, position, velocity, clip: ClipArrays):
    """Residuals of motions `[point, value]`, and their slopes `[point, value, column]`.

    In the parameters of `index` `[point, column]`, which change what is seen of a motion, not the
    motion: clock and camera.
    """

    def one(theta, index, noise, position, velocity):
        def residuals(change):
            moved = theta.at[index].add(change, mode="drop")
            return white_of(kind, moved, position, velocity, noise, clip)

        zero = jnp.zeros(index.shape[0])
        return residuals(zero), jax.jacfwd(residuals)(zero)

    return jax.vmap(one)(theta, index, noise, position, velocity)


@trace_cached(num_static=0)
def propose(size: Any, is_first: Any, here: Quadratic, there: Quadratic, before: Any, now: Any):
    """Whether proposals are accepted, and the next ones: one step of Levenberg-Marquardt.

    All of it is optimistix's: its trust region compares what a step was to bring with what it
    brought, and sets the damping of the next one.

    Args:
      size: `[point]`, of the trust region: one over the damping.
      is_first: `[point]`, that `there` is no proposal but the start.
      here: the points' costs.
      there: those of the proposals, where these were before they were bent.
      before: the curvature beside `normal` with which the proposals were made.
      now: the same for the next ones.

    Returns:
      The next size; whether `there` is accepted; the next steps, z, straight ahead; and what these
      promise to lower the cost by.
    """
    import equinox as eqx
    import optimistix as optx  # traced programs are kept: most calls need none of these

    trust = optx.ClassicalTrustRegion(high_cutoff=HIGH_CUTOFF)
    descent = optx.DampedNewtonDescent()

    def one(size: Any, is_first: Any, here: Quadratic, there: Quadratic, before: Any, now: Any):
        info = (_function_info(here, before), _function_info(there))
        region = eqx.tree_at(lambda s: s.step_size, trust.init(here.z, info[0]), size)
        size, accepts, _, _ = trust.step(is_first, here.z, there.z, *info, region)
        best = jax.tree.map(lambda a, b: jnp.where(accepts, b, a), here, there)
        state = descent.query(best.z, _function_info(best, now), descent.init(best.z, info[0]))
        step, _ = descent.step(size, state)
        promised = -trust.predict_reduction(step, _function_info(best, now))
        return size, accepts, step, promised

    return jax.vmap(one)(size, is_first, here, there, before, now)


def _function_info(at: Quadratic, beside: Any = 0.0) -> Any:
    import lineax as lx
    import optimistix as optx

    hessian = lx.MatrixLinearOperator(at.normal + beside, lx.positive_semidefinite_tag)
    return optx.FunctionInfo.EvalGradHessian(at.cost, at.gradient, hessian)
