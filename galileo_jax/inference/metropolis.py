"""Metropolis-Hastings for a problem: start, target and what must converge."""

import re
from collections.abc import Callable
from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np

from galileo_jax.inference.density import density_of
from galileo_jax.inference.fits.gradient import GradientFit
from galileo_jax.inference.fits.residuals import Residuals
from galileo_jax.inference.fits.valley import along, scattered, valley_round
from galileo_jax.inference.joint_problem import JointProblem
from galileo_jax.inference.posterior import Posterior
from galileo_jax.inference.result import IDENTIFIED_SD_Z
from galileo_jax.inference.samplers import sample, sampler_class
from galileo_jax.inference.samplers.driver import Progress, Settings

# R-hat < 1.01 needs about 50 effective draws for each half chain, so that fewer chains would be
# cheaper; but four learn too poor a proposal (measured: acceptance 0.14 against 0.41).
NUM_CHAINS = 8


def metropolis_posterior(
    trials: JointProblem,
    fit: GradientFit,
    seed: int,
    *,
    sampler: str = "mixture",
    settings: Settings = Settings(),  # noqa: B008
    num_chains: int = NUM_CHAINS,
    starts: np.ndarray | None = None,
    checkpoint: Path | None = None,
    identity: str = "",
    on_block: Callable[[Progress], None] | None = None,
) -> Posterior:
    """Samples the trials' posterior, started from and tuned by a gradient fit.

    Chains run in coordinates in which the fit's valley is straight (`fits/valley.py`).

    Args:
      trials: the target is `trials.log_density`, noise scales included.
      fit: its covariance is the first proposal; chains start dispersed along its valley.
      seed: same seed, same draws.
      sampler: a name in the samplers' registry.
      settings: how long.
      num_chains: how many.
      starts: `[chain, parameter]`, where they begin, in z, led along the valley as proposals
        are; default: dispersed in it.
      checkpoint: file that interrupted chains go on from; see `samplers.sample`.
      identity: of what is sampled; a checkpoint of anything else is refused.
      on_block: called with the progress.

    Returns:
      Draws in the parameters' units. Converged when the main parameters that the fit found
      identified, and the mass ratio, have R-hat and ESS as asked for.
    """
    residuals = Residuals(trials)
    valley = valley_round(fit, residuals)
    if starts is None:
        begin = scattered(valley, fit, residuals, seed, num_chains)
    else:
        begin = valley.straight(starts)
    sd = np.sqrt(np.diag(fit.covariance))
    watched = [
        (i, parameter.name)
        for i, parameter in enumerate(trials.parameters)
        if parameter.role != "nuisance" and sd[i] < IDENTIFIED_SD_Z
    ]

    def monitor(u: np.ndarray) -> dict[str, np.ndarray]:
        draws = valley(u)
        found = {name: draws[..., i] for i, name in watched}
        masses = [i for i, name in enumerate(trials.names) if re.fullmatch(r"m\d+", name)]
        for i, (one, other) in enumerate(pairwise(masses), 1):
            found[f"mass_ratio_{i}_{i + 1}"] = draws[..., one] - draws[..., other]
        return found or {"log_noise": draws[..., -1]}

    dim = valley.root.shape[1]
    posterior = sample(
        jax.random.key(seed),
        sampler_class(sampler).from_gaussian(jnp.zeros(dim), jnp.eye(dim)),  # pyright: ignore
        along(density_of(trials), valley),
        jnp.asarray(begin),
        trials.names,
        settings=settings,
        monitor=monitor,
        on_block=on_block,
        checkpoint=checkpoint,
        identity=identity,
    )
    count = posterior.stats["num_evaluations"] + residuals.num_rollouts
    posterior = replace(posterior, stats={**posterior.stats, "num_evaluations": count})
    return posterior.mapped(lambda u: trials.theta(valley(u)), trials.names)
