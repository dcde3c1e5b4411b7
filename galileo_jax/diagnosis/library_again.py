"""The library's effects once more, from where a better hypothesis has all else.

What a pair or a formula explains, one effect alone may explain as well, and a fit from nowhere have
missed: its valley is narrow, or lies far from where the model without effects is. There it is not
the effect that is wrong but the fit. So each effect starts again from the masses, frictions and
nuisances of what explains the data: as part of a pair where the pair has it, and over all of its
prior beside a formula.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from galileo_jax.diagnosis.candidate_starts import matched, scattered
from galileo_jax.diagnosis.candidates import Hypothesis, reduced
from galileo_jax.diagnosis.diagnosis import Candidate
from galileo_jax.diagnosis.pairs import most_alike
from galileo_jax.diagnosis.race import Race
from galileo_jax.diagnosis.verdict import LAPLACE_NATS, NUM_JOINED
from galileo_jax.inference.fits.gradient import GradientFitter
from galileo_jax.inference.joint_problem import JointProblem


def singles_of_pairs(race: Race, candidates: Sequence[Candidate]) -> list[Candidate]:
    """Single effects that come to a better valley from the best pairs, without the other effect.

    Args:
      race: of the candidates.
      candidates: ranked, pairs among them.
    """
    fitter, count = race.fitter, len(race.fitter.trials.model_parameters)
    singles: dict[tuple[str, ...], Candidate] = {
        c.effects: c for c in candidates if len(c.effects) == 1
    }
    starts: dict[tuple[str, ...], np.ndarray] = {}
    for pair in [c for c in candidates if len(c.effects) == 2][:NUM_JOINED]:
        for name in pair.effects:
            known = singles.get((name,))
            if known is not None and known.log_evidence < pair.log_evidence - LAPLACE_NATS:
                start = reduced(fitter.trials, pair.hypothesis, (name,)).fit.z[:count]
                starts.setdefault((name,), start)
    if not starts:
        return []
    sets: list[tuple[str, ...]] = list(starts)
    free = np.stack([fitter.trials.free(effects)[:count] for effects in sets])
    fits = fitter.fit_from(np.stack(list(starts.values())), free, np.arange(len(sets)))
    better = [
        (effects, fit.z[None, :count])
        for effects, fit in zip(sets, fits, strict=True)
        if fit.log_evidence > singles[effects].hypothesis.fit.log_evidence + LAPLACE_NATS
    ]
    if not better:
        return []
    made = race([race.base] * len(better), [e for e, _ in better], [z for _, z in better])
    return _better(made, candidates)


def singles_beside(race: Race, law: Candidate, candidates: Sequence[Candidate]) -> list[Candidate]:
    """Single effects and forms that come to a better valley from where a formula has all else.

    Args:
      race: of the candidates, which says what is fitted.
      law: a formula that explains the data.
      candidates: ranked.
    """
    fitter, trials = race.fitter, race.fitter.trials
    count = len(trials.model_parameters)
    beside = _without(trials, race.base, law.hypothesis)
    sets = [c.effects for c in candidates if len(c.effects) == 1 and c.law is None]
    free = np.stack([trials.free(effects)[:count] for effects in sets])
    bases = [beside.fit] * len(sets)
    matching, _ = matched(fitter, bases, sets, race.seed)
    both = zip(matching, scattered(fitter, bases, free, race.seed), strict=True)
    # Of the scattered starts the first is the best of those that leave all else where it is.
    starts = [np.concatenate([by_slope[:1], others[:1]]) for by_slope, others in both]
    of = np.repeat(np.arange(len(sets)), [len(own) for own in starts])
    lowest = _search_cost(law.hypothesis.of(trials), law.hypothesis)
    found = fitter.race(np.concatenate(starts), free[of], of, lowest).best
    ends = [np.flatnonzero(of == i) for i in range(len(sets))]
    best = np.array([own[np.argmin(found.cost[own])] for own in ends])
    near = most_alike(found.cost[best], lowest)
    if not near.size:
        return []
    z = list(found.z[best[near], None])
    return _better(race([beside] * len(near), [sets[i] for i in near], z), candidates)


def _search_cost(trials: JointProblem, hypothesis: Hypothesis) -> float:
    """Nats, at the search's noise."""
    fit, count = hypothesis.fit, len(trials.model_parameters)
    z, free = fit.z[None, :count], fit.free[None, :count]
    return float(GradientFitter(trials).search_costs(z, free)[0])


def _better(made: Sequence[Candidate], candidates: Sequence[Candidate]) -> list[Candidate]:
    """Those that are better than what was known; their score tests are as they were."""
    known = {c.effects: c for c in candidates}
    return [
        replace(new, score_z=old.score_z)
        for new in made
        if new.log_evidence > (old := known[new.effects]).log_evidence
    ]


def _without(trials: JointProblem, base: Hypothesis, law: Hypothesis) -> Hypothesis:
    """No effects, all else as beside a formula, which is of trials of its own: not a fit."""
    others = law.of(trials)
    at = [others.names.index(name) if name in others.names else -1 for name in trials.names]
    z = np.where(np.array(at) >= 0, law.fit.z[at], 0.0)
    jacobian = law.fit.jacobian[:, at[: len(trials.model_parameters)]]
    return Hypothesis(
        (),
        replace(
            base.fit,
            z=np.where(base.fit.free, z, 0.0),
            jacobian=np.where(base.fit.free[: jacobian.shape[1]], jacobian, 0.0),
            log_evidence=-np.inf,
        ),
    )
