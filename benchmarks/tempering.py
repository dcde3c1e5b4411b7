"""Adaptive tempered sequential Monte Carlo: from the prior to the posterior, with the evidence.

    p_t(z)  ~  N(z; 0, 1) L(z)^t,   t from 0 to 1
    every stage: resample; `num_moves` turns of the sampler `mixture` with the particles' own mean
                 and covariance; raise t until only half of the particles count
    at t = 1:    resample and move once more, for BlackJAX leaves its last particles weighted

It needs no fit to start from and finds several modes, where they are wide enough to hold particles
on the way; it costs many times what Metropolis-Hastings from a fit does.

Source: P. Del Moral, A. Doucet, A. Jasra, Sequential Monte Carlo samplers, J. R. Statist. Soc. B 68
(2006), 10.1111/j.1467-9868.2006.00553.x; BlackJAX's `adaptive_tempered_smc`.
"""

from dataclasses import dataclass
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from blackjax.smc import adaptive_tempered, resampling
from blackjax.smc.base import extend_params

from galileo_jax.inference.samplers.library.mixture import Mixture
from galileo_jax.inference.samplers.library.random_walk import optimal_log_scale
from galileo_jax.inference.samplers.sampler import LogDensity, State

LEAST_ESS = 0.5
LOWEST = -1e12  # the log-likelihood of a rollout that failed: -inf times t = 0 would be NaN
ROUNDING = 1e-9
RIDGE = 1e-12  # of the particles' covariance: a population of one has none
LAST_MOVES = 2  # at t = 1, in units of another stage's moves


@dataclass(frozen=True)
class Population:
    """The particles at t = 1, and how they came there.

    Attributes:
      z: `[particle, dim]`, all of the same weight.
      log_evidence: of the likelihood under the prior.
      temperatures: t after every stage, ending with 1.
      num_evaluations: of the likelihood.
    """

    z: np.ndarray
    log_evidence: float
    temperatures: tuple[float, ...]
    num_evaluations: int


def temper(
    key: jax.Array,
    log_likelihood: LogDensity,
    dim: int,
    *,
    num_particles: int = 512,
    num_moves: int = 3,
    max_stages: int = 200,
    is_moved: bool = True,
) -> Population:
    """Draws from N(z; 0, 1) L(z).

    Args:
      key: same key, same particles.
      log_likelihood: log L, `[dim] -> []`; a PyTree whose leaves may differ between calls
        without a new compilation.
      dim: of z.
      num_particles: per stage.
      num_moves: turns of each particle and stage: a step of a random walk, and four independent
        ones, without which evidences come out too low by many nats.
      max_stages: a population that has not arrived by then is an error.
      is_moved: at t = 1, too; without it the particles are not yet draws of the posterior, which
        the evidence needs not.

    Raises:
      RuntimeError: `max_stages` is reached.
    """
    key, of_start = jax.random.split(key)
    particles = jax.random.normal(of_start, (num_particles, dim))
    state = adaptive_tempered.init(particles)
    state = state._replace(tempering_param=jnp.zeros(()))
    log_evidence, temperatures = 0.0, []
    for _ in range(max_stages):
        key, of_stage = jax.random.split(key)
        state, increment = _stage(of_stage, state, log_likelihood, num_moves)
        log_evidence += float(increment)
        temperatures.append(float(state.tempering_param))
        if temperatures[-1] > 1.0 - ROUNDING:
            break
    else:
        raise RuntimeError(f"tempering has come to {temperatures[-1]:.3g} in {max_stages} stages")
    stages, each = len(temperatures), num_moves * Mixture.steps_per_turn + 3
    if not is_moved:
        count, ts = num_particles * stages * each, tuple(temperatures)
        return Population(np.asarray(state.particles), log_evidence, ts, count)
    moved = _last(key, state, log_likelihood, LAST_MOVES * num_moves)
    # A stage evaluates all particles for the next t, at the start of the moves, in each of them,
    # and for the weights.
    count = num_particles * (stages * each + LAST_MOVES * num_moves * Mixture.steps_per_turn + 1)
    return Population(np.asarray(moved), log_evidence, tuple(temperatures), count)


@eqx.filter_jit
def _stage(key: jax.Array, state: Any, log_likelihood: LogDensity, num_moves: int):
    kernel = adaptive_tempered.build_kernel(
        _log_prior, _finite(log_likelihood), _move, _start, resampling.systematic, LEAST_ESS
    )
    parameters = extend_params(_shape(state))  # pyright: ignore
    moved, info = kernel(key, state, num_moves, parameters)
    return moved, info.log_likelihood_increment


@eqx.filter_jit
def _last(key: jax.Array, state: Any, log_likelihood: LogDensity, num_moves: int) -> jax.Array:
    likelihood, shape = _finite(log_likelihood), _shape(state)
    of_choice, of_moves = jax.random.split(key)
    chosen = resampling.systematic(of_choice, state.weights, len(state.weights))

    def density(z: jax.Array) -> jax.Array:
        return _log_prior(z) + likelihood(z)

    def walk(key: jax.Array, z: jax.Array) -> jax.Array:
        def move(state: State, key: jax.Array):
            return _move(key, state, density, **shape)[0], None

        end, _ = jax.lax.scan(move, State(z, density(z)), jax.random.split(key, num_moves))
        return end.position

    keys = jax.random.split(of_moves, len(chosen))
    return jax.vmap(walk)(keys, state.particles[chosen])


def _start(position: jax.Array, log_density: LogDensity) -> State:
    return State(position, log_density(position))


def _move(key: jax.Array, state: State, log_density: LogDensity, mean: Any, cholesky: Any):
    scale = jnp.asarray(optimal_log_scale(mean.shape[0]))
    sampler = Mixture(mean=mean, cholesky=cholesky, log_scale=scale)
    moved, (_, info) = sampler.turn(key, state, log_density)
    return moved, info


def _shape(state: Any) -> dict[str, jax.Array]:
    """Of the weighted particles: their mean, and the Cholesky factor of their covariance."""
    mean = jnp.average(state.particles, axis=0, weights=state.weights)
    covariance = jnp.cov(state.particles, rowvar=False, aweights=state.weights)
    return {"mean": mean, "cholesky": jnp.linalg.cholesky(covariance + RIDGE * jnp.eye(len(mean)))}


def _log_prior(z: jax.Array) -> jax.Array:
    return -0.5 * jnp.sum(z**2)


def _finite(log_likelihood: LogDensity) -> LogDensity:
    def bounded(z: jax.Array) -> jax.Array:
        value = log_likelihood(z)
        return jnp.where(jnp.isfinite(value), value, LOWEST)

    return bounded
