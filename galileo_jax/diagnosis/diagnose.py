"""The loop: compare, ask which effect is missing, add it, and watch the error fall.

1. Fit the model without effects; compare it with the data.
2. Fit every effect of the library as a candidate, in one batch, and with them the forms without a
   physical name (`model/effects/forms`). Rank all by log odds: the evidence (Laplace), which
   charges for every parameter, and the prior, which charges for how many were tried. The model
   without effects will do and nothing convinces: the verdict is none.
3. Compare the best with the data, too. Where the best single effect leaves more than noise, or a
   form explains the data better, the best single effects are joined by others; pairs stand in the
   same table (rules: `verdict`).
4. What leaves only noise and is far more probable than all else is named, unless a clip like this
   one would not tell it from another (`expected_lead`). Several are ambiguous.
5. Where only a form explains the data, or nothing does, the missing force is inferred without a
   form (`missing_force`). Short formulas that it suggests are fitted in the model (`laws`) and
   stand in the same table. The verdict is law where one does what a named effect must; else it
   is unknown.
"""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace

import numpy as np

from galileo_jax.comparison.compare import Comparison, compare
from galileo_jax.diagnosis import reasons
from galileo_jax.diagnosis.advice import advice
from galileo_jax.diagnosis.candidates import Hypothesis, fit_candidates, reduced
from galileo_jax.diagnosis.diagnosis import Candidate, Diagnosis, Law, Round, Verdict
from galileo_jax.diagnosis.each_clip import EachClip, each_clip
from galileo_jax.diagnosis.expected_lead import expected_leads
from galileo_jax.diagnosis.laws.in_model import fitted_laws
from galileo_jax.diagnosis.leave_one_out import leave_one_out_rmse
from galileo_jax.diagnosis.missing_force import View, infer_missing_force, views_of
from galileo_jax.diagnosis.pairs import most_alike, not_tried, pairs_from_scratch, pairs_to_try
from galileo_jax.diagnosis.score_tests import best_gains, score_tests
from galileo_jax.diagnosis.verdict import (
    CONVINCING,
    NUM_JOINED,
    best_named,
    decisive_margin,
    explains,
    form_that_leads,
    is_contested_by_law,
    is_nothing_missing,
    law_contested,
    law_odds,
    law_verdict,
    log_prior,
    looked_at_again,
    may_decide,
    needs_laws,
    needs_pairs,
    other_formulas,
    ranked,
    rivals,
    to_add,
    to_compare,
    verdict_of,
    within_luck,
)
from galileo_jax.inference.fits.gradient import GradientFitter
from galileo_jax.inference.joint_problem import JointProblem
from galileo_jax.inference.result import error_of
from galileo_jax.model.effects.forms import FORM_NAMES


def diagnose(
    trials: JointProblem,
    *,
    seed: int = 0,
    add: str = "auto",
    on_stage: Callable[[str], None] = lambda _: None,
    on_round: Callable[[Round], None] = lambda _: None,
    on_candidate: Callable[[Candidate], None] = lambda _: None,
) -> Diagnosis:
    """Diagnoses trials whose models have the whole library.

    Args:
      trials: one clip or several of the same objects; `all_effects` (of the library, and the
        forms without a name) are the candidates.
      seed: of starts and replicates; the same seed gives the same diagnosis.
      add: "auto": add what the verdict names, until the model is adequate or nothing helps;
        "none": only say what is missing; a name: add that effect, whatever the verdict.
      on_stage: told what is being done.
      on_round: called with each round of the loop.
      on_candidate: called with each candidate as soon as it is fitted, and once more with each in
        the end, the best first: until then fits may get better, and probabilities change.

    Raises:
      ValueError: `add` names no effect of the trials' models.
    """
    fitter = fitter_of(trials)
    on_stage("fitting the model without effects")
    base = Hypothesis((), fitter.fit(seed, on_stage, effects=()))
    on_stage("comparing it with the data")
    first = Round(base, compare(trials, base.fit, seed))
    on_round(first)
    rounds = [first]
    library = [name for name in trials.all_effects if name not in FORM_NAMES]
    if add not in ("auto", "none"):
        trials.free([add])  # raises for unknown names
    on_stage(f"fitting {len(library)} candidates")
    is_adequate = first.comparison.is_adequate
    race = _Race(fitter, base, is_adequate, seed, on_candidate)
    singles = [(name,) for name in trials.all_effects]
    candidates = ranked(race([base] * len(singles), singles))
    for candidate in candidates:
        on_candidate(candidate)
    if add not in ("auto", "none"):
        chosen = next(c for c in candidates if c.effects == (add,))
        rounds.append(Round(chosen.hypothesis, compare(trials, chosen.hypothesis.fit, seed)))
        on_round(rounds[-1])
    why = reasons.without_effects(first.comparison)
    if is_nothing_missing(is_adequate, candidates):
        why = (*why, reasons.nothing_convinces(best_named(candidates), CONVINCING))
        return Diagnosis(tuple(rounds), candidates, Verdict("none", (), reasons=why))

    on_stage("comparing the best candidates with the data")
    compared: dict[tuple[str, ...], Comparison] = {}
    decisive = decisive_margin(is_adequate)
    candidates = _compared(trials, candidates, decisive, seed, compared)
    if needs_pairs(candidates):
        on_stage("fitting pairs of effects")
        pairs = _pairs(race, candidates, library)
        if pairs:
            form, single = form_that_leads(candidates), best_named(candidates)
            why = (*why, reasons.pairs_tried(single, form, len(pairs)))
        for candidate in pairs:
            on_candidate(candidate)
        on_stage("comparing the best pairs with the data")
        candidates = _compared(trials, (*candidates, *pairs), decisive, seed, compared)
        if not any(explains(c) for c in candidates):
            on_stage("searching pairs from the fit without effects")
            better = _from_scratch(race, base, candidates)
            for candidate in better:
                compared.pop(candidate.effects, None)
            known = {frozenset(c.effects): c for c in (*candidates, *better)}
            candidates = _compared(trials, known.values(), decisive, seed, compared)
    verdict = verdict_of(candidates, decisive)
    if verdict.status == "named":
        on_stage("looking at what could be confused with it")
        named = next(c for c in candidates if c.effects == verdict.effects)
        alike = within_luck(named, candidates, decisive)
        leads = expected_leads(trials, named, alike)
        verdict = looked_at_again(verdict, named, list(zip(alike, leads, strict=True)), decisive)
    views: list[View] = []
    if needs_laws(verdict):
        on_stage("inferring the missing force without a form")
        views = views_of(trials, base)
        on_stage("looking for a law")
        laws = _laws(trials, base, views, len(library))
        for candidate in ranked(laws):
            on_candidate(candidate)
        candidates = _compared(trials, (*candidates, *laws), decisive, seed, compared)
        verdict = _law_or(trials, verdict, candidates, decisive)
    verdict = replace(verdict, reasons=(*why, *verdict.reasons))
    chosen = to_add(verdict, candidates) if add == "auto" else None
    if chosen is not None:
        comparison = compared.get(chosen.effects)
        if comparison is None:
            comparison = compare(chosen.hypothesis.of(trials), chosen.hypothesis.fit, seed)
        rounds.append(Round(chosen.hypothesis, comparison))
        on_round(rounds[-1])
    scene = trials.problems[0].model.scene.surroundings
    verdict = replace(verdict, advice=advice(verdict, scene, len(trials.problems)))
    missing = None
    if verdict.status in ("unknown", "law"):
        missing = infer_missing_force(trials, base, seed, views)
    left_out: tuple[tuple[str, float, float], ...] = ()
    if len(trials.problems) > 1 and len(rounds) > 1:
        on_stage("predicting each clip from the others")
        before = leave_one_out_rmse(trials, rounds[0].hypothesis)
        last = rounds[-1].hypothesis
        after = leave_one_out_rmse(last.of(trials), last)
        left_out = tuple(zip((p.name for p in trials.problems), before, after, strict=True))
    each: tuple[EachClip, ...] = ()
    if len(trials.problems) > 1:
        on_stage("looking at each clip by itself")
        each = each_clip(trials, base.fit, first.comparison)
    return Diagnosis(tuple(rounds), candidates, verdict, missing, left_out, each)


def fitter_of(trials: JointProblem) -> GradientFitter:
    """What fits all hypotheses."""
    return GradientFitter(trials)


class _Race:
    """Fits candidates, and makes a table of what was fitted so far.

    Attributes:
      fitter: of trials whose models have the whole library.
      base: the fit without effects, from which evidence counts.
      is_adequate: whether that will do.
      seed: of the starts.
      on_candidate: called with each candidate as soon as it is fitted.
    """

    def __init__(
        self,
        fitter: GradientFitter,
        base: Hypothesis,
        is_adequate: bool,
        seed: int,
        on_candidate: Callable[[Candidate], None],
    ):
        self.fitter, self.base, self.is_adequate, self.seed = fitter, base, is_adequate, seed
        self._on_candidate = on_candidate
        self._made: dict[tuple[str, ...], Candidate] = {}

    def __call__(
        self, starts: Sequence[Hypothesis], sets: Sequence[tuple[str, ...]]
    ) -> list[Candidate]:
        """Fits sets of effects, each from the fit of all but its last; not ranked yet."""
        best = max((c.log_odds for c in self._made.values()), default=-np.inf)
        decisive = decisive_margin(self.is_adequate)

        def matters(hypotheses: Sequence[Hypothesis]) -> np.ndarray:
            log_odds = np.array([self._log_odds(one) for one in hypotheses])
            is_form = np.array(
                [any(name in FORM_NAMES for name in one.effects) for one in hypotheses]
            )
            return may_decide(log_odds, is_form, best, decisive, self.is_adequate)

        trials = self.fitter.trials
        scores = dict.fromkeys(sets, 0.0)
        for start in {id(start): start for start in starts}.values():
            own = [e for e, other in zip(sets, starts, strict=True) if other is start]
            scores |= dict(zip(own, score_tests(trials, start.fit, own).tolist(), strict=True))

        def make(hypothesis: Hypothesis) -> Candidate:
            made = self._candidate(hypothesis, scores[hypothesis.effects])
            self._made[made.effects] = made
            return made

        def on_fit(hypothesis: Hypothesis) -> None:
            made = make(hypothesis)
            table = ranked(self._made.values())
            self._on_candidate(next(c for c in table if c.effects == made.effects))

        found = fit_candidates(self.fitter, starts, sets, self.seed, matters, on_fit)
        return [
            made if (made := self._made[one.effects]).hypothesis.fit is one.fit else make(one)
            for one in found
        ]

    def _log_odds(self, hypothesis: Hypothesis) -> float:
        return self._log_evidence(hypothesis) + self._log_prior(hypothesis)

    def _log_evidence(self, hypothesis: Hypothesis) -> float:
        return hypothesis.fit.log_evidence - self.base.fit.log_evidence

    def _log_prior(self, hypothesis: Hypothesis) -> float:
        trials = self.fitter.trials
        library = [name for name in trials.all_effects if name not in FORM_NAMES]
        return log_prior(_odds(trials, hypothesis), len(library))

    def _candidate(self, hypothesis: Hypothesis, score_z: float) -> Candidate:
        trials, fit = self.fitter.trials, hypothesis.fit
        return Candidate(
            effects=hypothesis.effects,
            hypothesis=hypothesis,
            error=error_of(trials, trials.theta(fit.z, fit.free), fit.num_fitted, fit.pull),
            score_z=score_z,
            log_evidence=self._log_evidence(hypothesis),
            log_prior=self._log_prior(hypothesis),
            probability=0.0,
            p_value=None,
            confounded_with=(),
        )


def _laws(
    trials: JointProblem, base: Hypothesis, views: Sequence[View], num_effects: int
) -> list[Candidate]:
    """Formulas that the missing force suggests, fitted in the model."""
    made = []
    for law in fitted_laws(trials, base, views):
        fit, own = law.hypothesis.fit, law.hypothesis.of(trials)
        values = {name: f"{value:.4g}" for name, value in law.constants().items()}
        made.append(
            Candidate(
                effects=law.hypothesis.effects,
                hypothesis=law.hypothesis,
                error=error_of(own, own.theta(fit.z, fit.free), fit.num_fitted, fit.pull),
                score_z=float(np.sqrt(2 * max(law.score, 0.0))),
                log_evidence=fit.log_evidence - base.fit.log_evidence,
                log_prior=log_prior([law_odds(len(law.structure.factors))], num_effects),
                probability=0.0,
                p_value=None,
                confounded_with=(),
                law=Law(law.text, law.structure.family, law.source, values),
            )
        )
    return made


def _law_or(
    trials: JointProblem, before: Verdict, candidates: Sequence[Candidate], decisive: float
) -> Verdict:
    """The verdict law where a formula does what a named effect must; else as before.

    A pair of effects that a formula explains as well is named no more.
    """
    unknown = replace(before, status="unknown", effects=())
    verdict = law_verdict(candidates, decisive)
    if verdict is None:
        said = law_contested(candidates, decisive)
        is_open = is_contested_by_law(before, candidates, decisive)
        return replace(unknown if is_open else before, reasons=(*before.reasons, *said))
    best = next(c for c in candidates if c.effects == verdict.effects)
    alike = within_luck(best, other_formulas(best, candidates), decisive)
    leads = expected_leads(trials, best, alike)
    again = looked_at_again(verdict, best, list(zip(alike, leads, strict=True)), decisive)
    if again.status == "law":
        return again
    return replace(unknown, reasons=(*unknown.reasons, *again.reasons))


def _odds(trials: JointProblem, hypothesis: Hypothesis) -> list[float]:
    """Of each effect of a hypothesis, as far as the clip leads to expect it."""
    problem = trials.problems[0]
    theta = trials.of_clip(trials.theta(hypothesis.fit.z, hypothesis.fit.free), 0)
    named = dict(zip(problem.model.names, theta, strict=True))
    scene = problem.model.scene.surroundings
    effects = [e for e in problem.model.effects if e.name in hypothesis.effects]
    return [effect.odds(named, scene) for effect in effects]


def _pairs(
    race: _Race, candidates: Sequence[Candidate], library: Sequence[str]
) -> tuple[Candidate, ...]:
    """Pairs of the best single effects with others, and what could be confused with the best pair.

    The first are fitted from the single effects' fits. One that is as good as the best pair may not
    be reached from there: it is, from the best pair without one of its effects.
    """
    trials, seed = race.fitter.trials, race.seed
    singles = [c for c in candidates if not c.is_form][:NUM_JOINED]
    gains = np.stack(
        [
            best_gains(trials, one.hypothesis.fit, [(*one.effects, name) for name in library], seed)
            for one in singles
        ]
    )
    sets, starts = [], []
    for one, pairs in zip(singles, pairs_to_try(singles, library, gains), strict=True):
        sets += pairs
        starts += [one.hypothesis] * len(pairs)
    if not sets:
        return ()
    made = race(starts, sets)
    best = ranked(made)[0]
    sets, starts = [], []
    for kept in best.effects:
        start = reduced(trials, best.hypothesis, [kept])
        if others := not_tried(kept, library, made):
            gains = best_gains(trials, start.fit, others, seed)
            alike = most_alike(others, gains)
            sets += alike
            starts += [start] * len(alike)
    if sets:
        made += race(starts, sets)
    return ranked(made)


def _from_scratch(
    race: _Race, base: Hypothesis, candidates: Sequence[Candidate]
) -> list[Candidate]:
    """Pairs fitted from the fit without effects: those that come to a better valley, and new ones.

    A single effect's fit bends all else to do what the second one does, and the pair may not be
    reached from there, nor seem to promise much.
    """
    known = {frozenset(c.effects): c for c in candidates}
    sets = pairs_from_scratch(candidates)
    made = race([base] * len(sets), sets)
    olds = [known.get(frozenset(new.effects)) for new in made]
    return [
        new
        for old, new in zip(olds, made, strict=True)
        if old is None or new.log_evidence > old.log_evidence
    ]


def _compared(
    trials: JointProblem,
    candidates: Iterable[Candidate],
    decisive: float,
    seed: int,
    compared: dict[tuple[str, ...], Comparison],
) -> tuple[Candidate, ...]:
    """The table of candidates, the best with their p-values and with whom they are confounded.

    Args:
      trials: what the candidates were fitted to.
      candidates: in any order.
      decisive: difference in log odds, nats, at which one hypothesis rules out another.
      seed: of the replicates.
      compared: comparisons by effects; those made here are added.
    """
    table = ranked(candidates)
    for c in to_compare(table, decisive):
        if c.effects not in compared:
            compared[c.effects] = compare(c.hypothesis.of(trials), c.hypothesis.fit, seed)
    done = [
        replace(c, p_value=compared[c.effects].p_value) if c.effects in compared else c
        for c in table
    ]
    return tuple(replace(c, confounded_with=rivals(c, done)) for c in done)
