"""Whether a second effect promises more than it costs, where one effect explains the data already.

A comparison that looks for any misfit overlooks a small one of a known shape: a frame rate that is
wrong by 7 % beside a strip of friction left p = 0.03, and was 17 nats of evidence.
"""

from collections.abc import Sequence

import numpy as np

from galileo_jax.diagnosis.diagnosis import Candidate, Promise
from galileo_jax.diagnosis.race import Race
from galileo_jax.diagnosis.score_tests import promised_evidence
from galileo_jax.diagnosis.verdict import DECISIVE, NUM_JOINED, best_named, log_prior

# Nats by which slopes may promise too little: they promised 1.1 and 4.1 of what were 2.3 and 4.7.
SLOPE_NATS = 0.5


def promised_by_a_second(
    race: Race, candidates: Sequence[Candidate], library: Sequence[str]
) -> Promise | None:
    """The effect that promises most beside one of the best; None if none promises enough.

    Enough is more evidence, and so much that the pair would be less than `DECISIVE` nats behind the
    single effect: it might contest the name.

    Args:
      race: of the candidates.
      candidates: ranked, single effects.
      library: names of the effects.
    """
    if len(library) < 2:
        return None
    best = best_named(candidates)
    one, two = (log_prior([1.0] * count, len(library)) for count in (1, 2))
    promises = []
    for first in [c for c in candidates if c.name in library][:NUM_JOINED]:
        others = [name for name in library if name not in first.effects]
        if others:
            pairs = [(*first.effects, name) for name in others]
            fit = first.hypothesis.fit
            evidence = promised_evidence(race.fitter.trials, fit, pairs, race.seed)
            evidence = evidence + first.log_evidence - best.log_evidence
            at = int(np.argmax(evidence))
            promises.append(Promise(first.name, others[at], float(evidence[at]), one - two))
    if not promises:
        return None
    found = max(promises, key=lambda promise: promise.nats)
    least = max(found.price - DECISIVE - SLOPE_NATS, 0.0)
    return found if found.nats > least else None
