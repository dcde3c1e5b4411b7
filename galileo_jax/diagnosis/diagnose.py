"""The loop: compare, ask which effect is missing, add it, and watch the error fall.

1. Fit the model without effects; compare it with the data. Adequate: the verdict is none.
2. Fit every effect of the library as a candidate, in one batch; rank by evidence (Laplace),
   which charges for every parameter and, through the candidates' equal shares of the
   prior, for how many were tried. Compare the best with the data, too.
3. Adequate candidates whose evidence is close to that of the best cannot be distinguished
   from it. If there is only one, it is named; several are ambiguous (rules: `verdict`).
   The forms without a physical name (`model/effects/forms`) compete as well: an effect is not
   named if a form explains the data as well, and if only a form explains them, the verdict is
   unknown. Forms have prior odds of 1 to 20.
4. Where no single effect is adequate, the best is joined by those whose slopes stand out most.
5. Where no pair is adequate either, the verdict is unknown, and the missing force is
   inferred without a form (`missing_force`).
"""

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from galileo_jax.comparison.compare import Comparison, compare
from galileo_jax.diagnosis.advice import advice
from galileo_jax.diagnosis.candidates import Hypothesis, fit_candidates, score_tests
from galileo_jax.diagnosis.diagnosis import Candidate, Diagnosis, Round, Verdict
from galileo_jax.diagnosis.each_clip import EachClip, each_clip
from galileo_jax.diagnosis.leave_one_out import leave_one_out_rmse
from galileo_jax.diagnosis.missing_force import infer_missing_force
from galileo_jax.diagnosis.pairs import pairs_with, with_largest_scores
from galileo_jax.diagnosis.verdict import (
    best_named,
    decisive_margin,
    is_nothing_missing,
    probabilities,
    rivals,
    to_add,
    to_compare,
    verdict_of,
    verdict_of_pairs,
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
      on_candidate: called with each candidate when it is fitted, the best first.

    Raises:
      ValueError: `add` names no effect of the trials' models.
    """
    fitter = fitter_of(trials)
    on_stage("fitting the model without effects")
    base = Hypothesis((), fitter.fit(seed, effects=()))
    on_stage("comparing it with the data")
    first = Round(base, compare(trials, base.fit, seed))
    on_round(first)
    rounds = [first]
    library = [name for name in trials.all_effects if name not in FORM_NAMES]
    if add not in ("auto", "none"):
        trials.free([add])  # raises for unknown names
    on_stage(f"fitting {len(library)} candidates")
    singles = [(name,) for name in trials.all_effects]
    candidates = _candidates(fitter, base, singles, seed)
    for candidate in candidates:
        on_candidate(candidate)
    if add not in ("auto", "none"):
        chosen = next(c for c in candidates if c.effects == (add,))
        rounds.append(Round(chosen.hypothesis, compare(trials, chosen.hypothesis.fit, seed)))
        on_round(rounds[-1])
    is_adequate = first.comparison.is_adequate
    if is_nothing_missing(is_adequate, candidates):
        return Diagnosis(tuple(rounds), candidates, Verdict("none", ()))

    on_stage("comparing the best candidates with the data")
    candidates, compared = _compared(trials, candidates, seed)
    decisive = decisive_margin(is_adequate)
    verdict = verdict_of(candidates, base.misfit, decisive)
    if verdict is None:
        on_stage("fitting pairs of effects")
        best = best_named(candidates)
        pairs = pairs_with(best, library)
        joined: tuple[Candidate, ...] = ()
        if pairs:
            pairs = with_largest_scores(pairs, score_tests(trials, best.hypothesis, pairs))
            joined = _candidates(fitter, best.hypothesis, pairs, seed, base)
            for candidate in joined:
                on_candidate(candidate)
            joined, compared_pairs = _compared(trials, joined, seed)
            compared |= compared_pairs
        verdict = verdict_of_pairs(joined, best, base.misfit, decisive)
        if verdict.status != "unknown":
            candidates = (*joined, *candidates)
    chosen = to_add(verdict, candidates) if add == "auto" else None
    if chosen is not None:
        comparison = compared.get(chosen.effects)
        if comparison is None:
            comparison = compare(trials, chosen.hypothesis.fit, seed)
        rounds.append(Round(chosen.hypothesis, comparison))
        on_round(rounds[-1])
    scene = trials.problems[0].model.scene.surroundings
    verdict = replace(verdict, advice=advice(verdict, scene, len(trials.problems)))
    missing = None
    if verdict.status == "unknown":
        on_stage("inferring the missing force without a form")
        missing = infer_missing_force(trials, base, seed)
    left_out: tuple[tuple[str, float, float], ...] = ()
    if len(trials.problems) > 1 and len(rounds) > 1:
        on_stage("predicting each clip from the others")
        before = leave_one_out_rmse(trials, rounds[0].hypothesis)
        after = leave_one_out_rmse(trials, rounds[-1].hypothesis)
        left_out = tuple(zip((p.name for p in trials.problems), before, after, strict=True))
    each: tuple[EachClip, ...] = ()
    if len(trials.problems) > 1:
        on_stage("looking at each clip by itself")
        each = each_clip(trials, base.fit, first.comparison)
    return Diagnosis(tuple(rounds), candidates, verdict, missing, left_out, each)


def fitter_of(trials: JointProblem) -> GradientFitter:
    """What fits all hypotheses."""
    return GradientFitter(trials)


def _candidates(
    fitter: GradientFitter,
    start: Hypothesis,
    sets: Sequence[tuple[str, ...]],
    seed: int,
    base: Hypothesis | None = None,
) -> tuple[Candidate, ...]:
    """Fits and ranks candidates; evidence counts from `base` (default: `start`)."""
    base = base or start
    trials = fitter.trials
    found = fit_candidates(fitter, start, sets, seed)
    scores = score_tests(trials, start, sets)
    evidence = np.array([h.fit.log_evidence for h in found]) - base.fit.log_evidence
    evidence += np.log([_odds(trials, hypothesis) for hypothesis in found])
    probability = probabilities(evidence)
    made = []
    for i in np.argsort(-evidence):
        fit = found[i].fit
        made.append(
            Candidate(
                effects=found[i].effects,
                hypothesis=found[i],
                error=error_of(trials, trials.theta(fit.z, fit.free), fit.num_fitted, fit.pull),
                score_z=float(scores[i]),
                log_evidence=float(evidence[i]),
                probability=float(probability[i]),
                p_value=None,
                confounded_with=(),
            )
        )
    return tuple(made)


def _odds(trials: JointProblem, hypothesis: Hypothesis) -> float:
    """Of a set of effects, as far as the clip leads to expect them: of the likeliest."""
    problem = trials.problems[0]
    theta = trials.of_clip(trials.theta(hypothesis.fit.z, hypothesis.fit.free), 0)
    named = dict(zip(problem.model.names, theta, strict=True))
    scene = problem.model.scene.surroundings
    effects = [e for e in problem.model.effects if e.name in hypothesis.effects]
    return max(effect.odds(named, scene) for effect in effects)


def _compared(
    trials: JointProblem, candidates: tuple[Candidate, ...], seed: int
) -> tuple[tuple[Candidate, ...], dict[tuple[str, ...], Comparison]]:
    """The best candidates with their p-values and with whom they are confounded."""
    compared = {c.effects: compare(trials, c.hypothesis.fit, seed) for c in to_compare(candidates)}
    done = [
        replace(c, p_value=compared[c.effects].p_value) if c.effects in compared else c
        for c in candidates
    ]
    return tuple(replace(c, confounded_with=rivals(c, done)) for c in done), compared
