"""The default sampler: a Student-t independence kernel mixed with the random walk."""

from typing import ClassVar

import jax
import jax.numpy as jnp

from galileo_jax.inference.samplers.sampler import (
    SAMPLERS,
    Info,
    LogDensity,
    State,
    TunedSampler,
    metropolis_hastings,
)


@SAMPLERS.register
class Mixture(TunedSampler):
    """Turns of five Metropolis-Hastings steps: one of a random walk, four independent ones.

        the first:   y ~ N(x, s^2 L L^T), accepted with min(1, p(y) / p(x))
        the others:  y ~ t_10(mean, L L^T), accepted with min(1, p(y) t(x) / (p(x) t(y)))

    All leave the density invariant, so a turn does. No proposal depends on whether an earlier
    one of the turn was accepted, so that all are evaluated in one batch, which costs a
    fraction of five. Where a Laplace fit is good the independent ones make nearly independent
    draws; where it is not, the first is the random walk that always works. The tail, heavier
    than the Gaussian's, lets chains leave where p's is.

    How it compares with the random walk: docs/explanation/samplers.md.

    Source: Tierney, Markov chains for exploring posterior distributions, Ann. Statist. 22
    (1994), sections 2.3 and 2.4, 10.1214/aos/1176325750. Proposals ahead of time: A. E. Brockwell,
    Parallel Markov chain Monte Carlo simulation by pre-fetching, J. Comput. Graph. Statist. 15
    (2006), 10.1198/106186006X100579.
    """

    name: ClassVar[str] = "mixture"
    steps_per_turn: ClassVar[int] = 5
    degrees_of_freedom: ClassVar[float] = 10.0

    def turn(
        self, key: jax.Array, state: State, log_density: LogDensity
    ) -> tuple[State, tuple[State, Info]]:
        """A step of the random walk and four independent ones."""
        proposal_key, step_key = jax.random.split(key)
        proposals = self._proposals(proposal_key, state.position)
        values = jax.vmap(log_density)(proposals)
        is_independent = jnp.arange(self.steps_per_turn) > 0

        def step(state: State, ahead):
            key, proposal, value, is_independent = ahead

            def proposal_log_density(x, y):
                # The random walk's is symmetric and cancels out of the ratio.
                del x
                return jnp.where(is_independent, self._log_student_t(y), 0.0)

            state, info = metropolis_hastings(
                key, state, lambda _: value, lambda key, x: proposal, proposal_log_density
            )
            return state, (state, info)

        keys = jax.random.split(step_key, self.steps_per_turn)
        return jax.lax.scan(step, state, (keys, proposals, values, is_independent))

    def _proposals(self, key: jax.Array, position: jax.Array) -> jax.Array:
        """`[step, dim]`, the random walk's first."""
        shape, dtype = (self.steps_per_turn, position.shape[0]), position.dtype
        normal_key, chi_key = jax.random.split(key)
        noise = jax.random.normal(normal_key, shape, dtype) @ self.cholesky.T
        df = self.degrees_of_freedom
        # Chi squared with an even df; jax.random.chisquare doubles the compile time.
        waits = jax.random.exponential(chi_key, (self.steps_per_turn - 1, int(df) // 2), dtype)
        chi_squared = 2.0 * jnp.sum(waits, axis=1, keepdims=True)
        walk = position + jnp.exp(self.log_scale) * noise[:1]
        return jnp.concatenate([walk, self.mean + noise[1:] * jnp.sqrt(df / chi_squared)])

    def _log_student_t(self, position: jax.Array) -> jax.Array:
        """Log density of the t up to its constant, which cancels out of the ratio."""
        df = self.degrees_of_freedom
        whitened = jax.scipy.linalg.solve_triangular(
            self.cholesky, position - self.mean, lower=True
        )
        return -0.5 * (df + position.shape[0]) * jnp.log1p(jnp.sum(whitened**2) / df)
