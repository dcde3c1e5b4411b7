"""The thesis's estimator on a problem: velocity profiles, its similarities, its sampler."""

import jax
import jax.numpy as jnp
import numpy as np

from galileo_jax.errors import InputError
from galileo_jax.inference.posterior import Posterior
from galileo_jax.inference.problem import Problem
from galileo_jax.inference.samplers import thesis
from galileo_jax.parameters import inverse
from galileo_jax.similarity.similarity import similarity_class

SEARCHED = ("m1", "k1", "m2", "k2")


def thesis_posterior(
    problem: Problem, seed: int, similarity: str, acceptance: str, selection: str
) -> tuple[Posterior, dict[str, float]]:
    """Runs the thesis's 16 x 75 steps.

    Everything but the masses and frictions stays at its prior's middle, as in the thesis.

    Returns:
      All chain states (with the coin's acceptance no posterior), and the thesis's answer.

    Raises:
      InputError: the clip does not have two objects.
    """
    if not set(SEARCHED) <= set(problem.names):
        raise InputError("--preset thesis: two objects expected; this clip has one")
    measure = similarity_class(similarity)()
    observation = problem.observation
    both = observation.mask[:, 1:] & observation.mask[:, :-1]
    dt = jnp.asarray(np.diff(observation.times_s))
    observed = jnp.asarray(np.where(both[:, None], np.nan_to_num(observation.velocity_m_s), 0.0))
    where = np.array([problem.names.index(name) for name in SEARCHED])
    steps = jnp.asarray(problem.coarse_steps)
    priors = [problem.parameters[i] for i in where]
    rest = jnp.zeros(len(problem.model.parameters))

    def log_similarity(theta: jax.Array) -> jax.Array:
        z = rest.at[where].set(inverse(priors, theta))
        velocity = jnp.diff(problem.predict(z, steps), axis=-1) / dt
        return measure(velocity, observed, jnp.asarray(both))

    answer = thesis.infer(
        jax.random.key(seed),
        log_similarity,
        SEARCHED,
        acceptance=thesis.Acceptance(acceptance),
        selection=thesis.Selection(selection),
    )
    draws = answer.posterior.draws
    rest_theta = problem.theta(np.zeros(len(problem.names)))
    whole = np.tile(rest_theta, (*draws.shape[:2], 1))
    whole[..., where] = draws
    posterior = Posterior(
        names=problem.names,
        draws=whole,
        log_density=answer.posterior.log_density,
        status=answer.posterior.status,
        stats=answer.posterior.stats,
        provenance=answer.posterior.provenance,
    )
    return posterior, dict(zip(SEARCHED, map(float, answer.estimate), strict=True))
