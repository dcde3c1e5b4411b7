"""The best pairs once more, from many starts, where nothing explains the data.

Two effects have up to six constants, and the valley of the right ones may be narrow: the starts
that serve for one effect may all miss it. Where nothing explains the data the best pair may be the
true one in a side valley, and a wider search is worth its seconds.
"""

from collections.abc import Sequence
from dataclasses import replace

from galileo_jax.diagnosis.diagnosis import Candidate
from galileo_jax.diagnosis.race import Race
from galileo_jax.diagnosis.verdict import LAPLACE_NATS, NUM_JOINED
from galileo_jax.inference.fits.gradient import GradientFitter

NUM_STARTS, NUM_REFINED = 256, 16  # four times as many as of one hypothesis


def widely_searched(race: Race, candidates: Sequence[Candidate]) -> list[Candidate]:
    """Of the best pairs those that come to a better valley; without score tests of their own.

    Args:
      race: of the candidates.
      candidates: ranked, pairs among them.
    """
    trials, count = race.fitter.trials, len(race.fitter.trials.model_parameters)
    settings = replace(race.fitter.settings, num_starts=NUM_STARTS, num_refined=NUM_REFINED)
    wide = GradientFitter(trials, settings)
    found = []
    for pair in [c for c in candidates if len(c.effects) == 2][:NUM_JOINED]:
        fit = wide.fit(race.seed, effects=pair.effects)
        if fit.log_evidence > pair.hypothesis.fit.log_evidence + LAPLACE_NATS:
            (made,) = race([race.base], [pair.effects], [fit.z[None, :count]])
            found.append(replace(made, score_z=pair.score_z))
    return found
