"""Whether a fit describes the posterior round it, and where to go on from if not.

Starts that agree and a misfit like noise do not prove that a fit is the best: of 60 rendered clips
two were 6 nats behind a valley next to theirs, where boxes that part after the hit meet again a
frame earlier. Points drawn round the fit and weighed by importance (`importance_sampling.py`) tell:
where few of them have all the weight, the posterior is elsewhere, and these are near it.
"""

from collections.abc import Sequence

import numpy as np
from jaxtyping import Float

from galileo_jax.inference.fits.importance_sampling import ENOUGH_ESS, weighed
from galileo_jax.inference.fits.laplace import GradientFit
from galileo_jax.inference.fits.residuals import Residuals

NUM_AT_ONCE, MOST = 256, 1024  # draws, and in all where few have all the weight
NUM_STARTS = 4
MOST_PARAMETERS = 40  # of more, as many trials have, hardly a draw weighs anything


def to_go_on_from(
    fits: Sequence[GradientFit], residuals: Residuals, seed: int
) -> Float[np.ndarray, "start parameter"]:
    """Starts, z of the model's parameters; none where the fits describe the posterior.

    Args:
      fits: the best of each valley, the best first.
      residuals: of the trials that were fitted.
      seed: of the draws.
    """
    count = len(fits[0].steps)
    if fits[0].free.sum() > MOST_PARAMETERS:
        return np.empty((0, count))
    found = weighed(fits, residuals, seed, num=NUM_AT_ONCE, most=MOST)
    if found.better is None and found.ess >= ENOUGH_ESS:
        return np.empty((0, count))
    starts = found.z[np.argsort(-found.log_weights)[:NUM_STARTS]]
    return (
        starts[:, :count] if found.better is None else np.vstack([found.better, starts])[:, :count]
    )
