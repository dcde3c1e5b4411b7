"""Candidates: every effect of the library as a hypothesis, in a race.

Each effect is fitted together with all other parameters, from several starting points
(`candidate_starts`), and the evidence is computed by Laplace's method. The evidence charges for
every parameter, according to how much of its prior the data exclude.

    1. All starts of all candidates descend in one batch. A start leaves it where it has come to
       the valley of a better one of its candidate, or is far behind: of its candidate, or of the
       best of all, and its next step promises little of that.
    2. The best end of each candidate is refined at the clip's own noise, the most promising first.
    3. Every candidate starts once more from values that reproduce the motion of the best one, with
       all other parameters as in that, or that have the place, time or length of the best one where
       it has one, too. Where it comes to another valley that may be better, that is refined, too.
       So it is not where no candidate can come to matter.
    4. Of the candidates that the verdict may hang on, every valley that was found is refined, and
       the best fit once more with its positive nuisances moved. Of the others this could change
       nothing that a rule looks at.
    5. Where a verdict hangs on a few nats, the evidence of those that are so close is mended by
       rollouts round the valleys that were found (`inference/fits/weighed.py`).
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from galileo_jax.diagnosis.candidate_starts import alike_or_matched, matched, scattered
from galileo_jax.diagnosis.mended_evidence import mended
from galileo_jax.inference.fits.descent import Descended, ends_of, in_valley
from galileo_jax.inference.fits.ends import valleys
from galileo_jax.inference.fits.gradient import GradientFit, GradientFitter
from galileo_jax.inference.fits.weighed import Weighed
from galileo_jax.inference.joint_problem import JointProblem

NUM_REFITTED, OUT_OF_THE_RACE = 6, 100.0  # candidates, unless so many nats behind the best
NUM_AT_ONCE = 6  # refined in one batch: the sooner the first can be shown
# Between Laplace's and mended evidence, nats: those of hypotheses that describe the data differ by
# up to 2.5, and alike.
ALIKE_NATS = 3.0
MAY_STILL_GAIN = 5.0  # nats that a valley with more cost in the search may yet have the better of


@dataclass(frozen=True)
class Hypothesis:
    """Effects that are there, and the fit with them.

    Attributes:
      effects: names, in the order in which they were added.
      fit: of all parameters.
      trials: whose parameters these are, where not the diagnosis's own: of a law.
      weighed: its evidence, mended; None where Laplace's has to do.
    """

    effects: tuple[str, ...]
    fit: GradientFit
    trials: JointProblem | None = None
    weighed: Weighed | None = None

    def of(self, trials: JointProblem) -> JointProblem:
        """The trials that it was fitted to, where the diagnosis's own are `trials`."""
        return self.trials or trials

    def evidence_over(self, base: "Hypothesis") -> float:
        """Log evidence less that of another, nats.

        Like with like, where only Laplace's is known: its errors are alike where hypotheses are.
        Where that of the other is off by more than such errors are (a fit far from the data has a
        bent valley), its mended evidence counts for all, so that all are measured from one place.
        """
        if base.weighed is None:
            return self.fit.log_evidence - base.fit.log_evidence
        known, mended = base.fit.log_evidence, base.weighed.log_evidence
        if self.weighed is None:
            return self.fit.log_evidence - (known if abs(known - mended) < ALIKE_NATS else mended)
        return self.weighed.log_evidence - mended

    def is_same(self, other: "Hypothesis") -> bool:
        """Whether it has the same fit and evidence."""
        return self.fit is other.fit and self.weighed is other.weighed

    @property
    def misfit(self) -> float:
        """By how much chi2 per measured value exceeds 1, which noise alone would give."""
        return self.fit.chi2 / self.fit.num_values - 1.0


def reduced(trials: JointProblem, hypothesis: Hypothesis, effects: Sequence[str]) -> Hypothesis:
    """A hypothesis with only some of its effects, all else as it is: to start from, not a fit."""
    fit, free = hypothesis.fit, trials.free(effects)
    return Hypothesis(tuple(effects), replace(fit, z=np.where(free, fit.z, 0.0), free=free))


def not_far_behind(hypotheses: Sequence[Hypothesis]) -> np.ndarray:
    """Which hypotheses are within `OUT_OF_THE_RACE` nats of the best evidence."""
    evidence = np.array([one.fit.log_evidence for one in hypotheses])
    return evidence > evidence.max() - OUT_OF_THE_RACE


def none_of(hypotheses: Sequence[Hypothesis]) -> np.ndarray:
    """None of them."""
    return np.zeros(len(hypotheses), bool)


def fit_candidates(
    fitter: GradientFitter,
    bases: Sequence[Hypothesis],
    candidates: Sequence[tuple[str, ...]],
    seed: int,
    matters: Callable[[Sequence[Hypothesis]], np.ndarray] = not_far_behind,
    on_fit: Callable[[Hypothesis], None] = lambda _: None,
    needs_mending: Callable[[Sequence[Hypothesis]], np.ndarray] = none_of,
    starts: Sequence[np.ndarray] | None = None,
) -> list[Hypothesis]:
    """Fits every candidate (a set of effects), all in one race.

    Args:
      fitter: of trials whose models have the whole library.
      bases: of each candidate the fit with all but its last effect, to start from.
      candidates: names of all effects of each.
      seed: of the starts.
      matters: `[hypothesis]`, on which the verdict may hang; only these are fitted in every valley.
      on_fit: called with each as soon as it is fitted; the fit may yet become better. Of many the
        one whose slope explains most is fitted from there and shown before the race, and again in
        its turn.
      needs_mending: `[hypothesis]`, of which Laplace's evidence will not do.
      starts: of each candidate `[start, model parameter]`, z; None: scattered and matched ones.
    """
    trials = fitter.trials
    count = len(trials.model_parameters)
    free = np.stack([trials.free(effects)[:count] for effects in candidates])
    from_fits = [base.fit for base in bases]
    shown: dict[int, GradientFit] = {}
    if starts is None:
        matching, gains = matched(fitter, from_fits, candidates, seed)
        if len(candidates) > NUM_AT_ONCE:
            best = int(np.argmax(gains))
            [fit] = fitter.fit_from(matching[best][:1], free[[best]], np.zeros(1, int))
            on_fit(Hypothesis(tuple(candidates[best]), fit))
            shown[best] = fit
            matching[best][0] = fit.z[:count]  # others that are far behind that leave the race
        both = zip(scattered(fitter, from_fits, free, seed), matching, strict=True)
        starts = [np.concatenate(pair) for pair in both]
    of = np.repeat(np.arange(len(candidates)), [len(own) for own in starts])
    found = fitter.race(np.concatenate(starts), free[of], of)
    ends = [valleys(found.best, _left(found, of == i)) for i in range(len(candidates))]
    first = np.array([rows[0] for rows in ends])
    fits: dict[int, GradientFit] = {}
    ends_at: dict[int, list[GradientFit]] = {i: [] for i in range(len(candidates))}

    def take(i: int, fit: GradientFit) -> None:
        ends_at[i].append(fit)
        if i not in fits or fit.log_evidence > fits[i].log_evidence:
            fits[i] = fit

    for i, fit in fitter.polish_in_turn(found.best.z[first], free, _by_promise(found, first)):
        take(i, fit)
        on_fit(Hypothesis(tuple(candidates[i]), fit))
    hypotheses = [Hypothesis(tuple(e), fits[i]) for i, e in enumerate(candidates)]
    if matters(hypotheses).any():
        _second(fitter, from_fits, candidates, found, first, fits, take, seed)
        hypotheses = [Hypothesis(tuple(e), fits[i]) for i, e in enumerate(candidates)]
    evidence = np.array([fits[i].log_evidence for i in range(len(candidates))])
    winners = [int(i) for i in np.argsort(-evidence) if matters(hypotheses)[i]][:NUM_REFITTED]
    if winners:
        count = len(trials.model_parameters)
        again = []
        for i in winners:  # what is there was refined roughly: all of it starts once more
            fit = fits.pop(i)
            beside = [other.z[:count] for other in ends_at[i] if other is not fit]
            again.append([*fitter.with_variants(fit), *beside, *found.best.z[ends[i][1:]]])
        owner = np.repeat(np.arange(len(winners)), [len(own) for own in again])
        whose = np.array(winners)[owner]
        polished = fitter.polish(np.concatenate(again), free[whose], owner)
        for row, fit in polished.items():
            take(int(whose[row]), fit)
    for i, fit in shown.items():
        take(i, fit)
    hypotheses = [Hypothesis(tuple(e), fits[i]) for i, e in enumerate(candidates)]
    for i in np.flatnonzero(needs_mending(hypotheses)).tolist():
        fit, found = mended(fitter, ends_at[i], seed, bases[i].fit)
        hypotheses[i] = replace(hypotheses[i], fit=fit, weighed=found)
    return hypotheses


def _left(found: Descended, is_own: np.ndarray) -> np.ndarray:
    """The ends of a candidate's starts that no other joined, `[end]`, indices."""
    return np.unique(ends_of(found.joined)[is_own])


def _by_promise(found: Descended, rows: np.ndarray) -> list[np.ndarray]:
    """Candidates by the evidence that their ends promise, `[part][candidate]`: a few, the others.

    A part takes as many steps as its slowest candidate, so that many parts would take many.
    """
    volume = -0.5 * np.linalg.slogdet(found.best.normal[rows])[1]
    order = np.argsort(found.best.cost[rows] - volume, kind="stable")
    return [part for part in np.split(order, [NUM_AT_ONCE]) if part.size]


def _second(
    fitter: GradientFitter,
    bases: Sequence[GradientFit],
    candidates: Sequence[tuple[str, ...]],
    found: Descended,
    first: np.ndarray,
    fits: dict[int, GradientFit],
    take: Callable[[int, GradientFit], None],
    seed: int,
) -> None:
    """Searches for all candidates but the best once more, from where the best has all else.

    Another explanation that is as good leaves the masses, frictions and nuisances where the best
    one has them; from the fit without an effect, which has bent them, it may not be reached.

    Args:
      fitter: of the trials.
      bases: of each candidate the fit without its last effect.
      candidates: names of all effects of each.
      found: of the first search.
      first: `[candidate]`, where the best end of each stands in it.
      fits: by candidate.
      take: called with each candidate that is fitted once more, and its fit.
      seed: of the starts.
    """
    trials, count = fitter.trials, len(fitter.trials.model_parameters)
    best = max(fits, key=lambda i: fits[i].log_evidence)
    others = [i for i in range(len(candidates)) if i != best]
    if not others:
        return
    without = {
        id(base): replace(
            base, z=np.where(base.free, fits[best].z, 0.0), jacobian=fits[best].jacobian
        )
        for base in bases
    }
    named = [candidates[i] for i in others]
    starts, _ = matched(fitter, [without[id(bases[i])] for i in others], named, seed)
    free = np.stack([trials.free(effects)[:count] for effects in named])
    of = np.arange(len(others))
    lowest = float(found.best.cost[first].min())
    matching = np.concatenate([own[:1] for own in starts])
    last = [effects[-1] for effects in named]
    near = alike_or_matched(fitter, fits[best], candidates[best][-1], matching, free, last)
    second = fitter.race(near, free, of, lowest)
    known = first[others]
    most = np.minimum(found.best.cost[known] + MAY_STILL_GAIN, lowest + OUT_OF_THE_RACE)
    is_new = [
        cost < most[i] and not _is_known(second, i, found, int(known[i]))
        for i, cost in enumerate(second.best.cost)
    ]
    rows = np.flatnonzero(is_new)
    if rows.size:
        polished = fitter.polish(second.best.z[rows], free[rows], np.arange(len(rows)))
        for row, fit in polished.items():
            take(others[rows[row]], fit)


def _is_known(second: Descended, row: int, found: Descended, known: int) -> bool:
    """Whether an end of the second search is in the valley of one of the first."""
    both = type(found.best)(
        *(np.stack([a[known], b[row]]) for a, b in zip(found.best, second.best, strict=True))
    )
    best, other = (0, 1) if both.cost[0] <= both.cost[1] else (1, 0)
    return bool(in_valley(both, best, np.array([other]))[0])
