"""From a gradient fit to a posterior, as narrow or wide as rollouts round the fit say.

The slopes at the best fit know only what is next to it. Where two events come close to each other
(bodies that nearly touch again; one that stops as the other passes) the misfit has a corner, and an
interval from slopes may be five times too narrow. So points round the fit are rolled out and
weighed by importance (`fits/importance_sampling.py`), and the posterior is drawn from these.
"""

from dataclasses import replace

import numpy as np

from galileo_jax.inference.fits.gradient import SETTLED, GradientFit
from galileo_jax.inference.fits.importance_sampling import weighed
from galileo_jax.inference.fits.posterior_check import MOST_PARAMETERS
from galileo_jax.inference.fits.residuals import Residuals
from galileo_jax.inference.fits.sized_density import SizedDensity
from galileo_jax.inference.joint_problem import JointProblem
from galileo_jax.inference.laplace import NUM_DRAWS, laplace_posterior
from galileo_jax.inference.posterior import ESS, Posterior, Status
from galileo_jax.inference.resampled import resampled

# At once, and in all until they are worth `ENOUGH` draws: a mean is then good to .02 sd.
NUM_AT_ONCE, MOST, ENOUGH = 512, 8192, 2000.0
# Worth so few, widths are good to a tenth, and it is said; to a quarter, and slopes know as much.
FEW, TOO_FEW = 100.0, 10.0


def fit_posterior(trials: JointProblem, fit: GradientFit, seed: int) -> Posterior:
    """Draws of the posterior round a fit and the valleys beside it, sizes integrated.

    Those of the normal approximation, at the most probable sizes, where weighed draws are worth too
    few, or rollouts are slow (all engines but the rigid one in a plane).

    Args:
      trials: that were fitted.
      fit: the best, with the valleys beside it.
      seed: same seed, same draws.
    """
    is_quick = all(problem.engine.name == "rigid" for problem in trials.problems)
    if not is_quick or fit.code not in SETTLED or fit.free.sum() > MOST_PARAMETERS:
        return laplace_posterior(trials, fit, seed)
    valleys = (fit, *fit.beside)
    residuals = Residuals(trials)
    density = None if fit.sizes is None else SizedDensity(trials, fit, residuals.clips)
    found = weighed(
        valleys, residuals, seed, num=NUM_AT_ONCE, most=MOST, enough=ENOUGH, density=density
    )
    num_rollouts = fit.stats.get("num_rollouts", 0) + residuals.num_rollouts
    stats = {**fit.stats, "num_rollouts": num_rollouts}
    if found.ess < TOO_FEW:
        normal = laplace_posterior(trials, fit, seed)
        return replace(normal, stats=stats, provenance={**normal.provenance, ESS: found.ess})
    generator = np.random.default_rng([seed, 31])
    which = resampled(found.log_weights, NUM_DRAWS, generator)
    return Posterior(
        names=trials.names,
        draws=trials.theta(found.z[which], fit.free)[None],
        log_density=found.log_density[which][None],
        status=Status.CONVERGED,
        stats=stats,
        provenance={"method": "grad", "seed": seed, "code": fit.code.name, ESS: found.ess},
    )


def uncertain_width(posterior: Posterior) -> str | None:
    """One line where the intervals of a fit are themselves uncertain; None where they are not."""
    ess = posterior.provenance.get(ESS)
    if ess is None or ess >= FEW:
        return None
    return (
        f"the intervals are uncertain: points round the fit are worth {ess:.0f} draws of the "
        f"posterior ({FEW:.0f} would do); --method mh draws more"
    )
