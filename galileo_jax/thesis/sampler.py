"""The thesis's estimator: short chains of uniform proposals; the best sample wins."""

from dataclasses import replace
from typing import ClassVar, Literal, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from galileo_jax.inference.joint_problem import JointProblem
from galileo_jax.inference.posterior import Posterior
from galileo_jax.inference.samplers.driver import Settings, sample
from galileo_jax.inference.samplers.sampler import (
    AbstractSampler,
    Info,
    LogDensity,
    State,
    metropolis_hastings,
    turn_of_one,
)
from galileo_jax.runtime.errors import InputError
from galileo_jax.thesis.similarity import similarity as similarity_of

SEARCHED = ("m1", "k1", "m2", "k2")
NUM_CHAINS = 16
NUM_STEPS = 75
NARROW = 0.05
WIDE = 0.5
WIDE_EVERY = 20
Acceptance = Literal["coin", "metropolis"]
"""Of proposals: better ones always, others by a fair coin (the thesis); or with
min(1, p(y) q(x | y) / (p(x) q(y | x))), which samples p."""
Selection = Literal["best", "least_variance"]
"""Of the answer: the sample of highest similarity in all chains (the thesis), or the mean of the
chain whose variances over the parameters sum to least."""


class ThesisState(NamedTuple):
    """`position` `[dim]` in (0, 1), its `log_density` `[]` and the `num_steps` `[]` made."""

    position: jax.Array
    log_density: jax.Array
    num_steps: jax.Array


class Thesis(AbstractSampler):
    """Uniform proposals within 0.05 of each parameter, within 0.5 on every 20th step.

        y_i ~ U(max(0, x_i - w), min(1, x_i + w)),  w = 0.5 if step % 20 == 0 else 0.05
        keep y if p(y) >= p(x), else if a coin shows heads

    The thesis redraws a parameter until it falls into (0, 1); the distribution is the same.
    With the coin the chain samples nothing in particular: it is a search, and its draws
    are no posterior. Near 0 and 1 the proposals are not symmetric; "metropolis" corrects it.
    """

    name: ClassVar[str] = "thesis"
    acceptance: Acceptance = eqx.field(static=True, default="coin")

    def init(self, position: jax.Array, log_density: LogDensity) -> ThesisState:
        """The state at `position`, which must lie in (0, 1)."""
        return ThesisState(position, log_density(position), jnp.zeros((), jnp.int32))

    def turn(self, key: jax.Array, state: ThesisState, log_density: LogDensity):
        """One step."""
        return turn_of_one(*self.step(key, state, log_density))

    def step(
        self, key: jax.Array, state: ThesisState, log_density: LogDensity
    ) -> tuple[ThesisState, Info]:
        """One step."""
        num_steps = state.num_steps + 1
        half_width = jnp.where(num_steps % WIDE_EVERY == 0, WIDE, NARROW)

        def propose(key, position):
            low, high = _interval(position, half_width)
            return jax.random.uniform(key, position.shape, position.dtype, minval=low, maxval=high)

        def proposal_log_density(x, y):
            low, high = _interval(x, half_width)
            is_possible = (low <= y) & (y <= high)
            return jnp.sum(jnp.where(is_possible, -jnp.log(high - low), -jnp.inf))

        if self.acceptance == "metropolis":
            current = State(state.position, state.log_density)
            moved, info = metropolis_hastings(
                key, current, log_density, propose, proposal_log_density
            )
            return ThesisState(moved.position, moved.log_density, num_steps), info

        proposal_key, coin_key = jax.random.split(key)
        position = propose(proposal_key, state.position)
        proposed = log_density(position)
        # A NaN is not better, and no coin makes it acceptable.
        rate = jnp.where(jnp.isnan(proposed), 0.0, jnp.where(proposed >= state.log_density, 1, 0.5))
        is_accepted = jax.random.bernoulli(coin_key, rate)
        moved = ThesisState(
            jnp.where(is_accepted, position, state.position),
            jnp.where(is_accepted, proposed, state.log_density),
            num_steps,
        )
        return moved, Info(rate, is_accepted)


def infer(
    key: jax.Array,
    log_similarity: LogDensity,
    *,
    acceptance: Acceptance = "coin",
    num_chains: int = NUM_CHAINS,
) -> Posterior:
    """All states of 16 chains of 75 steps from uniform starts; of a coin's no posterior at all.

    Costs 16 x 76 = 1216 evaluations, whatever happens, where nothing else is asked for.
    `log_similarity`: `[dim] -> []` of the parameters themselves, each in (0, 1).
    """
    start_key, key = jax.random.split(key)
    return sample(
        key,
        Thesis(acceptance=acceptance),
        log_similarity,
        jax.random.uniform(start_key, (num_chains, len(SEARCHED)), minval=1e-6),
        SEARCHED,
        settings=Settings(warmup_steps=0, block_steps=25, max_steps=NUM_STEPS, stops_early=False),
    )


def select(posterior: Posterior, selection: Selection) -> np.ndarray:
    """The answer `[dim]` of the chains, in (0, 1); a point, without an interval.

    A better proposal is always kept, so the best state is also the best proposal.
    """
    if selection == "best":
        return posterior.flat()[np.argmax(posterior.log_density)]
    spread = posterior.draws.var(axis=1).sum(axis=-1)
    return posterior.draws[np.argmin(spread)].mean(axis=0)


def _interval(position, half_width):
    return jnp.maximum(position - half_width, 0.0), jnp.minimum(position + half_width, 1.0)


def thesis_posterior(
    trials: JointProblem,
    seed: int,
    similarity: str,
    acceptance: Acceptance,
    selection: Selection,
    num_chains: int = NUM_CHAINS,
) -> tuple[Posterior, dict[str, float]]:
    """Runs the thesis's 16 x 75 steps, or 75 of another number of chains.

    Everything but the masses and frictions stays at its prior's middle, as in the thesis.

    Returns:
      All chain states (with the coin's acceptance no posterior), and the thesis's answer.

    Raises:
      InputError: the clip does not have two objects.
    """
    (problem,) = trials.problems
    if not set(SEARCHED) <= set(trials.names):
        raise InputError("--preset thesis: two objects expected; this clip has one")
    observation = problem.observation
    both = observation.mask[:, 1:] & observation.mask[:, :-1]
    dt = jnp.asarray(np.diff(observation.times_s))
    observed = jnp.asarray(np.where(both[:, None], np.nan_to_num(observation.velocity_m_s), 0.0))
    where = np.array([trials.names.index(name) for name in SEARCHED])
    rest_theta = trials.theta(np.zeros(len(trials.names)))
    rest = jnp.asarray(trials.of_clip(rest_theta, 0))

    def log_similarity(theta: jax.Array) -> jax.Array:
        predicted = problem.predict(rest.at[where].set(theta))
        velocity = jnp.diff(predicted, axis=-1) / dt
        return similarity_of(similarity, velocity, observed, jnp.asarray(both))

    chains = infer(
        jax.random.key(seed),
        log_similarity,
        acceptance=acceptance,
        num_chains=num_chains,
    )
    draws = chains.draws
    whole = np.tile(rest_theta, (*draws.shape[:2], 1))
    whole[..., where] = draws
    posterior = replace(chains, names=trials.names, draws=whole)
    return posterior, dict(zip(SEARCHED, map(float, select(chains, selection)), strict=True))
