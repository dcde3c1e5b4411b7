"""Metropolis-Hastings for a problem: start, target and what must converge."""

import re
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from itertools import pairwise
from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np

from galileo_jax.inference.density import density_of
from galileo_jax.inference.fits.gradient import GradientFit
from galileo_jax.inference.fits.residuals import Residuals
from galileo_jax.inference.fits.transport_map import (
    Coordinates,
    Valley,
    along,
    learned,
    scattered,
    valley_round,
)
from galileo_jax.inference.joint_problem import JointProblem
from galileo_jax.inference.posterior import Posterior
from galileo_jax.inference.result import IDENTIFIED_SD_Z
from galileo_jax.inference.samplers import sample, sampler_class
from galileo_jax.inference.samplers.driver import Progress, Settings

# R-hat < 1.01 needs about 50 effective draws for each half chain, so that fewer chains would be
# cheaper; but four learn too poor a proposal (measured: acceptance 0.14 against 0.41).
NUM_CHAINS = 8
# Where the fit's widths are wrong, the warm-up's few draws do not mend them. Whoever has not
# converged after so many steps knows the posterior well enough to set off anew.
FIRST_STEPS = 1000


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

    Chains run in coordinates in which the fit's valley is straight (`transport_map.py`). Where they
    have not converged after `FIRST_STEPS`, what they have drawn so far tunes a second run, from
    where they are, in coordinates and with proposals that suit it; it alone is returned.

    Args:
      trials: the target is `trials.log_density`, noise scales included; where the fit has sizes of
        imperfections, integrated over these.
      fit: its covariance is the first proposal; chains start dispersed along its valley.
      seed: same seed, same draws.
      sampler: a name in the samplers' registry.
      settings: how long, both runs together.
      num_chains: how many.
      starts: `[chain, parameter]`, where they begin, in z, led along the valley as proposals
        are; default: dispersed in it.
      checkpoint: file that interrupted chains go on from; see `samplers.sample`. That of a
        second run is beside it.
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
    first, second = _parts(settings)
    total = settings.warmup_steps + settings.max_steps
    chains = _Chains(trials, fit, seed, sampler, total, checkpoint, identity, on_block)
    dim = valley.root.shape[1]
    at = Coordinates(valley, np.zeros(dim), np.eye(dim))
    posterior = chains.run(at, begin, first, is_second=False)
    count = posterior.stats["num_evaluations"] + residuals.num_rollouts
    if second is not None and not posterior.is_converged:
        u = posterior.draws
        at = learned(valley, u[:, u.shape[1] // 2 :].reshape(-1, dim))
        last = u[:, -1]
        begin = last if at.valley is valley else at.valley.straight(valley(last))
        posterior = chains.run(at, begin, second, is_second=True)
        count += posterior.stats["num_evaluations"]
    posterior = replace(posterior, stats={**posterior.stats, "num_evaluations": count})
    return posterior.mapped(lambda u: trials.theta(at.valley(u)), trials.names)


@dataclass(frozen=True)
class _Chains:
    """What both runs have in common, as `metropolis_posterior` has it; `total`: steps of both."""

    trials: JointProblem
    fit: GradientFit
    seed: int
    sampler: str
    total: int
    checkpoint: Path | None
    identity: str
    on_block: Callable[[Progress], None] | None

    def run(self, at: Coordinates, begin: np.ndarray, part: Settings, is_second: bool) -> Posterior:
        """One of them, from `begin` in coordinates `at`."""
        before = self.total - part.warmup_steps - part.max_steps if is_second else 0

        def report(state: Progress) -> None:
            assert self.on_block is not None
            whole = replace(state, num_steps=before + state.num_steps, max_steps=self.total)
            self.on_block(whole)

        kernel, key = sampler_class(self.sampler), jax.random.key(self.seed)
        file = self.checkpoint
        if file is not None and is_second:
            file = file.with_name(f"{file.name}.second")
        mean, covariance = jnp.asarray(at.mean), jnp.asarray(at.covariance)
        return sample(
            jax.random.fold_in(key, 1) if is_second else key,
            kernel.from_gaussian(mean, covariance),  # pyright: ignore
            along(density_of(self.trials, self.fit), at.valley),
            jnp.asarray(begin),
            self.trials.names,
            settings=part,
            monitor=partial(_watch(self.trials, self.fit), at.valley),
            on_block=report if self.on_block else None,
            checkpoint=file,
            identity=self.identity,
        )


def _watch(
    trials: JointProblem, fit: GradientFit
) -> Callable[[Valley, np.ndarray], dict[str, np.ndarray]]:
    """Draws `[chain, draw, dim]` along a valley to what must converge: what the fit tells."""
    sd = np.sqrt(np.diag(fit.covariance))
    told = [
        (i, parameter.name)
        for i, parameter in enumerate(trials.parameters)
        if parameter.role != "nuisance" and sd[i] < IDENTIFIED_SD_Z
    ]
    masses = [i for i, name in enumerate(trials.names) if re.fullmatch(r"m\d+", name)]

    def watch(valley: Valley, u: np.ndarray) -> dict[str, np.ndarray]:
        draws = valley(u)
        found = {name: draws[..., i] for i, name in told}
        for i, (one, other) in enumerate(pairwise(masses), 1):
            found[f"mass_ratio_{i}_{i + 1}"] = draws[..., one] - draws[..., other]
        return found or {"log_noise": draws[..., -1]}

    return watch


def _parts(settings: Settings) -> tuple[Settings, Settings | None]:
    """The settings of the first run and, where there may be one, of the second."""
    few = FIRST_STEPS - FIRST_STEPS % settings.block_steps
    rest = settings.max_steps - few - settings.warmup_steps
    if not settings.stops_early or few <= 0 or rest <= 0:
        return settings, None
    return replace(settings, max_steps=few), replace(settings, max_steps=rest)
