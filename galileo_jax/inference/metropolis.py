"""Metropolis-Hastings for a problem: start, target and what must converge."""

import re
from collections.abc import Callable
from itertools import pairwise
from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np

from galileo_jax.inference.fits.gradient import GradientFit
from galileo_jax.inference.model_error import add_model_error
from galileo_jax.inference.posterior import Posterior
from galileo_jax.inference.result import IDENTIFIED_SD_Z
from galileo_jax.inference.samplers import dispersed_starts, sample, sampler_class
from galileo_jax.inference.samplers.driver import Progress, Settings
from galileo_jax.inference.trials import Trials

# R-hat < 1.01 needs about 50 effective draws for each half chain, so that fewer chains would be
# cheaper; but four learn too poor a proposal (measured: acceptance 0.14 against 0.41).
NUM_CHAINS = 8


def metropolis_posterior(
    trials: Trials,
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

    Args:
      trials: the target is `trials.log_density`, noise scales included.
      fit: its covariance is the first proposal; chains start dispersed round it.
      seed: same seed, same draws.
      sampler: a name in the samplers' registry.
      settings: how long.
      num_chains: how many.
      starts: `[chain, parameter]`, where they begin, in z; default: dispersed round the fit.
      checkpoint: file that interrupted chains go on from; see `samplers.sample`.
      identity: of what is sampled; a checkpoint of anything else is refused.
      on_block: called with the progress.

    Returns:
      Draws in the parameters' units. Converged when the main parameters that the fit found
      identified, and the mass ratio, have R-hat and ESS as asked for.
    """
    start_key, key = jax.random.split(jax.random.key(seed))
    mode, covariance = jnp.asarray(fit.z), jnp.asarray(fit.covariance)
    if starts is None:
        starts = np.asarray(dispersed_starts(start_key, mode, covariance, num_chains))
    sd = np.sqrt(np.diag(fit.covariance))
    watched = [
        (i, parameter.name)
        for i, parameter in enumerate(trials.parameters)
        if parameter.role != "nuisance" and sd[i] < IDENTIFIED_SD_Z
    ]

    def monitor(draws: np.ndarray) -> dict[str, np.ndarray]:
        found = {name: draws[..., i] for i, name in watched}
        masses = [i for i, name in enumerate(trials.names) if re.fullmatch(r"m\d+", name)]
        for i, (one, other) in enumerate(pairwise(masses), 1):
            found[f"mass_ratio_{i}_{i + 1}"] = draws[..., one] - draws[..., other]
        return found or {"log_noise": draws[..., -1]}

    posterior = sample(
        key,
        sampler_class(sampler).from_gaussian(mode, covariance),  # pyright: ignore
        trials.log_density,
        jnp.asarray(starts),
        trials.names,
        settings=settings,
        monitor=monitor,
        on_block=on_block,
        checkpoint=checkpoint,
        identity=identity,
    )
    return posterior.mapped(
        lambda z: add_model_error(trials.theta(z), trials.names, seed), trials.names
    )
