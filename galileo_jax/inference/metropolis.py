"""Metropolis-Hastings for a problem: start, target and what must converge."""

import re
from collections.abc import Callable
from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np

from galileo_jax.inference.fits.gradient import GradientFit
from galileo_jax.inference.fits.residuals import Residuals
from galileo_jax.inference.fits.transport_map import Valley, valley_round
from galileo_jax.inference.joint_problem import JointProblem
from galileo_jax.inference.log_posterior import density_of
from galileo_jax.inference.posterior import Posterior
from galileo_jax.inference.result import IDENTIFIED_SD_Z
from galileo_jax.inference.samplers.driver import Progress, Settings, sample
from galileo_jax.inference.samplers.sampler import SAMPLERS

# R-hat < 1.01 needs about 50 effective draws for each half chain, so that fewer chains would be
# cheaper; but four learn too poor a proposal (measured: acceptance 0.14 against 0.41).
NUM_CHAINS = 8
# Where the fit's widths are wrong, the warm-up's few draws do not mend them. Whoever has not
# converged after so many steps knows the posterior well enough to set off anew.
FIRST_STEPS = 1000
NUM_SCATTERED = 64  # that starts are chosen from


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

    Draws are in the parameters' units: of the posterior of `trials`, noise scales included; where
    the fit has sizes of imperfections, integrated over these. They have converged when the main
    parameters that the fit found identified, and the mass ratio, have R-hat and ESS as asked for.

    Args:
      trials: what was fitted.
      fit: its covariance is the first proposal; chains start dispersed along its valley.
      seed: same seed, same draws.
      sampler: a name in the samplers' registry.
      settings: how long, both runs together.
      num_chains: how many.
      starts: `[chain, parameter]`, in z, led along the valley; default: dispersed in it.
      checkpoint: as of `samplers.sample`; that of a second run is beside it.
      identity: as of `samplers.sample`.
      on_block: called with the progress.
    """
    residuals, key = Residuals(trials), jax.random.key(seed)
    valley = valley_round(fit, residuals)
    dim = valley.root.shape[1]
    total = settings.warmup_steps + settings.max_steps
    watch = _watch(trials, fit)

    def run(
        valley: Valley, begin: np.ndarray, mean: np.ndarray, covariance: np.ndarray,
        part: Settings, before: int = 0,
    ) -> Posterior:  # fmt: skip
        """Draws of w after `before` steps: of none in the first run."""

        def report(state: Progress) -> None:
            if on_block is not None:
                on_block(replace(state, num_steps=before + state.num_steps, max_steps=total))

        file = checkpoint
        if before and checkpoint:
            file = checkpoint.with_name(f"{checkpoint.name}.second")
        return sample(
            jax.random.fold_in(key, 1) if before else key,
            SAMPLERS[sampler].from_gaussian(jnp.asarray(mean), jnp.asarray(covariance)),
            density_of(trials, fit, valley),
            jnp.asarray(begin),
            trials.names,
            settings=part,
            monitor=lambda w: watch(valley(w)),
            on_block=report,
            checkpoint=file,
            identity=identity,
        )

    if starts is None:
        begin = scattered(valley, fit, residuals, seed, num_chains)
    else:
        begin = valley.straight(starts)
    first, second = _parts(settings)
    posterior = run(valley, begin, np.zeros(dim), np.eye(dim), first)
    count = posterior.stats["num_evaluations"] + residuals.num_rollouts
    if second is not None and not posterior.is_converged:
        w = posterior.draws
        later, last = w[:, w.shape[1] // 2 :].reshape(-1, dim), w[:, -1]
        old, (valley, mean, covariance) = valley, learned(valley, later)
        begin = last if valley is old else valley.straight(old(last))
        before = first.warmup_steps + first.max_steps
        posterior = run(valley, begin, mean, covariance, second, before)
        count += posterior.stats["num_evaluations"]
    posterior = replace(posterior, stats={**posterior.stats, "num_evaluations": count})
    return posterior.mapped(lambda w: trials.theta(valley(w)), trials.names)


def learned(valley: Valley, w: np.ndarray) -> tuple[Valley, np.ndarray, np.ndarray]:
    """Coordinates that suit draws, and the draws' mean and covariance in them.

    The valley's own; or straight ones, if in these a normal density comes closer to the draws: a
    fit whose widths are wrong, at a kink of the misfit, has wrong bends, too. The determinants are
    constant, so that those of the covariances compare.

    `valley`: in whose coordinates the draws were made. `w`: `[draw, parameter]`.
    """
    z = valley(w)
    bent, straight = np.cov(w, rowvar=False), np.cov(z, rowvar=False)
    size = np.linalg.slogdet(bent)[1] + 2 * valley.log_volume
    if size <= np.linalg.slogdet(straight)[1]:
        return valley, w.mean(axis=0), bent
    dim = len(straight)
    none, axes = np.zeros((dim, dim)), np.eye(dim)
    unbent = Valley(z.mean(axis=0), np.linalg.cholesky(straight), axes, none, none)
    return unbent, np.zeros(dim), axes


def scattered(
    valley: Valley, fit: GradientFit, residuals: Residuals, seed: int, num: int
) -> np.ndarray:
    """Starts for chains, `[chain, parameter]`, in w; wider than the posterior, as R-hat asks.

    Drawn from the density to the power 1/2, by importance from N(0, 2): where the map leads
    astray, far off, none is left.
    """
    size = int(np.sum(fit.free[: len(fit.steps)]))
    generator = np.random.default_rng([seed, 10])
    w = np.sqrt(2) * generator.standard_normal((max(NUM_SCATTERED, num), valley.root.shape[1]))
    costs = residuals.costs(fit.points(valley(w)))
    surplus = 0.25 * np.sum(w[:, :size] ** 2, axis=1) - 0.5 * costs
    # The largest of log-weights with Gumbel noise: a draw without replacement.
    return w[np.argsort(-(surplus + generator.gumbel(size=len(w))))[:num]]


def _watch(trials: JointProblem, fit: GradientFit) -> Callable[[np.ndarray], dict[str, np.ndarray]]:
    """Draws `[chain, draw, dim]`, z, to what must converge: what the fit tells."""
    sd = np.sqrt(np.diag(fit.covariance))
    told = [
        (i, parameter.name)
        for i, parameter in enumerate(trials.parameters)
        if parameter.role != "nuisance" and sd[i] < IDENTIFIED_SD_Z
    ]
    masses = [i for i, name in enumerate(trials.names) if re.fullmatch(r"m\d+", name)]

    def watch(draws: np.ndarray) -> dict[str, np.ndarray]:
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
