"""The thesis's estimator on a problem: velocity profiles, its similarities, its sampler."""

from dataclasses import replace

import jax
import jax.numpy as jnp
import numpy as np

from galileo_jax.inference.joint_problem import JointProblem
from galileo_jax.inference.posterior import Posterior
from galileo_jax.runtime.errors import InputError
from galileo_jax.thesis.sampler import NUM_CHAINS, Acceptance, Selection, infer
from galileo_jax.thesis.similarity import similarity_class

SEARCHED = ("m1", "k1", "m2", "k2")


def thesis_posterior(
    trials: JointProblem,
    seed: int,
    similarity: str,
    acceptance: str,
    selection: str,
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
    measure = similarity_class(similarity)()
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
        return measure(velocity, observed, jnp.asarray(both))

    answer = infer(
        jax.random.key(seed),
        log_similarity,
        SEARCHED,
        acceptance=Acceptance(acceptance),
        selection=Selection(selection),
        num_chains=num_chains,
    )
    draws = answer.posterior.draws
    whole = np.tile(rest_theta, (*draws.shape[:2], 1))
    whole[..., where] = draws
    posterior = replace(answer.posterior, names=trials.names, draws=whole)
    return posterior, dict(zip(SEARCHED, map(float, answer.estimate), strict=True))
