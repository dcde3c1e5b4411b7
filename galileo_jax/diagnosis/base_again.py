"""The model without effects once more, from where an effect led its nuisances.

An effect may lead not because it is there but because its fit came to a valley that the fit without
it missed: boxes that part after a hit and meet again have one for every order of their touches,
and a nuisance reaches the same motion as an effect of the same kind. So where an effect leads by so
much that it could be named, the model without it starts again from that fit.
"""

from collections.abc import Sequence

import numpy as np

from galileo_jax.diagnosis.candidates import Hypothesis, reduced
from galileo_jax.diagnosis.diagnosis import Candidate
from galileo_jax.diagnosis.verdict import LAPLACE_NATS, NUM_JOINED
from galileo_jax.inference.fits.gradient import GradientFitter


def better_base(
    fitter: GradientFitter, base: Hypothesis, candidates: Sequence[Candidate]
) -> Hypothesis | None:
    """A better fit without effects; None where those with effects lead to none.

    Args:
      fitter: of trials whose models have the whole library.
      base: the fit without effects.
      candidates: ranked.
    """
    leading = [c for c in candidates if c.log_evidence > LAPLACE_NATS][:NUM_JOINED]
    if not leading:
        return None
    starts = np.concatenate(
        [fitter.along_nuisances(reduced(fitter.trials, c.hypothesis, ()).fit) for c in leading]
    )
    free = np.tile(base.fit.free[: starts.shape[1]], (len(starts), 1))
    fits = fitter.polish(starts, free, np.zeros(len(starts), int)).values()
    fit = max(fits, key=lambda one: one.log_evidence)
    return Hypothesis((), fit) if fit.log_evidence > base.fit.log_evidence + LAPLACE_NATS else None
