"""A short search for many hypotheses: which of them come near the best one at all."""

from collections.abc import Sequence

import numpy as np
from jaxtyping import Float

from galileo_jax.diagnosis.candidate_starts import matched
from galileo_jax.inference.fits.gradient import GradientFit, GradientFitter
from galileo_jax.inference.fits.starts import scattered_starts

NUM_SCATTERED = 32  # over all priors; the best of them descends
MOST_DESCENDED = 32  # candidates


def short_search(
    fitter: GradientFitter,
    bases: Sequence[GradientFit],
    candidates: Sequence[tuple[str, ...]],
    seed: int,
    lowest: float,
    most: int = MOST_DESCENDED,
) -> tuple[Float[np.ndarray, "candidate parameter"], Float[np.ndarray, " candidate"]]:
    """Where candidates come to from two starts each.

    One best matches what the base leaves without the candidate's last effect; from there all else
    may stay as it is. The other is the best of some over all priors: where much else has to
    change, too, the first ends in a side valley.

    Args:
      fitter: of the trials.
      bases: of each candidate what it starts from, without its last effect.
      candidates: names of all effects of each.
      seed: of the starts.
      lowest: cost that others have already come to, nats.
      most: candidates that descend, those whose first start costs least.

    Returns:
      z of the better end of each, and its cost at the search's noise, nats. Of many candidates
      those that begin far behind stay where they match: their costs are infinite.
    """
    trials, count = fitter.trials, len(fitter.trials.model_parameters)
    free = np.stack([trials.free(effects)[:count] for effects in candidates])
    first = np.stack([own[0] for own in matched(fitter, bases, candidates, seed)[0]])
    z, cost = first.copy(), np.full(len(free), np.inf)
    some = np.argsort(fitter.search_costs(first, free), kind="stable")[:most]
    z[some], cost[some] = _descended(fitter, first[some], free[some], seed, lowest)
    return z, cost


def _descended(
    fitter: GradientFitter, first: np.ndarray, free: np.ndarray, seed: int, lowest: float
) -> tuple[np.ndarray, np.ndarray]:
    """From a start of each and the best of some over all priors: the better end, and its cost."""
    trials, count = fitter.trials, free.shape[1]
    every = np.stack([scattered_starts(trials, row, NUM_SCATTERED, seed) for row in free])
    of = np.repeat(np.arange(len(free)), NUM_SCATTERED)
    costs = fitter.search_costs(every.reshape(len(of), count), free[of]).reshape(len(free), -1)
    scattered = every[np.arange(len(free)), np.argmin(costs, axis=1)]
    starts = np.concatenate([first, scattered])
    owner = np.tile(np.arange(len(free)), 2)
    found = fitter.race(starts, free[owner], owner, lowest).best
    cost = found.cost.reshape(2, -1)
    better = np.argmin(cost, axis=0)
    each = np.arange(len(free))
    return found.z.reshape(2, len(free), count)[better, each], cost[better, each]
