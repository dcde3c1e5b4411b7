"""The loop: compare, ask which effect is missing, add it, and watch the error fall.

1. Fit the model without effects; compare it with the data. Adequate: the verdict is none.
2. Fit every effect of the library as a candidate, in one batch; rank by evidence (Laplace),
   which charges for every parameter and, through the candidates' equal shares of the
   prior, for how many were tried. Compare the best with the data, too.
3. Candidates that are adequate and whose evidence is within a factor of the best's cannot
   be told from it: one is named, several are ambiguous.
   The forms without a name (`effects/forms`) are candidates, too: what they explain as well is
   not named, and what they alone explain is unknown. They are twenty times less likely ahead.
4. Where no single effect is adequate, the best is joined by those whose slopes stand out most.
5. Where no pair is adequate either, the verdict is unknown, and the missing force is
   inferred without a form (`missing_force`).
"""

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from galileo_jax.comparison.compare import ADEQUATE_P, Comparison, compare
from galileo_jax.diagnosis.advice import advice
from galileo_jax.diagnosis.candidates import Hypothesis, fit_candidates, score_tests
from galileo_jax.diagnosis.diagnosis import Candidate, Diagnosis, Round, Verdict
from galileo_jax.diagnosis.each_clip import EachClip, each_clip
from galileo_jax.diagnosis.left_out import left_out_rmse
from galileo_jax.diagnosis.missing_force import infer_missing_force
from galileo_jax.effects.forms import FORM_NAMES
from galileo_jax.inference.fits.gradient import GradientFit, GradientFitter
from galileo_jax.inference.result import error_of
from galileo_jax.inference.trials import Trials

# Evidence of one candidate over another, in nats, at which the other is given up: one in twenty.
DECISIVE = 3.0
NUM_COMPARED = 6  # of the best candidates
# A candidate explains the data if the comparison shows no misfit, or hardly any of what was there:
# a camera that sees hundredths of a pixel finds fault with every model.
EXPLAINS_P, LEFT_SHARE = 1e-5, 0.01
# Two effects have enough freedom to come near anything: a pair must leave nothing at all.
PAIR_P = 0.05
PRIOR_NONE = 0.5  # that nothing is missing; the candidates share the rest
# In nats, at which a candidate is believed although the comparison shows no misfit: tests that
# look everywhere see less than one that knows where to look.
CONVINCING = 10.0
LEAST_GAIN = 10.0  # in nats, for another effect to be added
NUM_JOINED = 8  # of the other effects, to the best: those with the largest scores


def diagnose(
    trials: Trials,
    *,
    seed: int = 0,
    add: str = "auto",
    on_stage: Callable[[str], None] = lambda _: None,
    on_round: Callable[[Round], None] = lambda _: None,
) -> Diagnosis:
    """Diagnoses trials whose models have the whole library.

    Args:
      trials: one clip or several of the same objects; `all_effects` (of the library, and the
        forms without a name) are the candidates.
      seed: of starts and replicates; the same seed gives the same diagnosis.
      add: "auto": add what the verdict names, until the model is adequate or nothing helps;
        "none": only say what is missing; a name: add that effect, whatever the verdict.
      on_stage: told what is being done.
      on_round: told each round of the loop.

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
    if add not in ("auto", "none"):
        chosen = next(c for c in candidates if c.effects == (add,))
        rounds.append(_round(trials, chosen.hypothesis, seed, on_round))
    named = [c for c in candidates if not c.is_form]
    if first.comparison.is_adequate and named[0].log_evidence < CONVINCING:
        return Diagnosis(tuple(rounds), candidates, Verdict("none", ()))

    on_stage("comparing the best candidates with the data")
    candidates, compared = _compared(trials, candidates, seed)
    # Where nothing shows but to those who know where to look, more candidates stay possible.
    decisive = DECISIVE * (2.0 if first.comparison.is_adequate else 1.0)
    verdict = _verdict(candidates, base.fit, decisive)
    if verdict is None:
        on_stage("fitting pairs of effects")
        best = named[0]
        pairs = _pairs(trials, best, [name for name in library if name not in best.effects])
        joined = _candidates(fitter, best.hypothesis, pairs, seed, base)
        joined, compared_pairs = _compared(trials, joined, seed)
        compared |= compared_pairs
        verdict = _verdict(joined, base.fit, decisive)
        gain = joined[0].log_evidence - best.log_evidence
        is_clean = joined[0].p_value is not None and joined[0].p_value >= PAIR_P
        if verdict is not None and gain > LEAST_GAIN and is_clean:
            candidates = (*joined, *candidates)
        else:
            verdict = Verdict("unknown", ())
    if add == "auto" and verdict.status != "unknown":
        names = ("+".join(verdict.effects), verdict.effects[0])  # of all that are named, or of one
        chosen = next(c for c in candidates if c.name in names)
        extra = Round(chosen.hypothesis, compared[chosen.effects])
        on_round(extra)
        rounds.append(extra)
    elif add == "auto":
        # What helps most is shown, though it does not explain the data.
        best = named[0]
        if best.log_evidence > LEAST_GAIN:
            if best.effects in compared:
                rounds.append(Round(best.hypothesis, compared[best.effects]))
                on_round(rounds[-1])
            else:
                rounds.append(_round(trials, best.hypothesis, seed, on_round))
    scene = trials.problems[0].model.scene.surroundings
    verdict = replace(verdict, advice=advice(verdict, scene, len(trials.problems)))
    missing = None
    if verdict.status == "unknown":
        on_stage("inferring the missing force without a form")
        missing = infer_missing_force(trials, base, seed)
    left_out: tuple[tuple[str, float, float], ...] = ()
    if len(trials.problems) > 1 and len(rounds) > 1:
        on_stage("predicting each clip from the others")
        before = left_out_rmse(trials, rounds[0].hypothesis)
        after = left_out_rmse(trials, rounds[-1].hypothesis)
        left_out = tuple(zip((p.name for p in trials.problems), before, after, strict=True))
    each: tuple[EachClip, ...] = ()
    if len(trials.problems) > 1:
        on_stage("looking at each clip by itself")
        each = each_clip(trials, base.fit, first.comparison)
    return Diagnosis(tuple(rounds), candidates, verdict, missing, left_out, each)


def fitter_of(trials: Trials) -> GradientFitter:
    """What fits all hypotheses."""
    return GradientFitter(trials)


def _round(
    trials: Trials, hypothesis: Hypothesis, seed: int, on_round: Callable[[Round], None]
) -> Round:
    extra = Round(hypothesis, compare(trials, hypothesis.fit, seed))
    on_round(extra)
    return extra


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
    weight = np.append(evidence + np.log((1 - PRIOR_NONE) / len(found)), np.log(PRIOR_NONE))
    weight = np.exp(weight - weight.max())
    probability = weight / weight.sum()
    made = []
    for i in np.argsort(-evidence):
        fit = found[i].fit
        made.append(
            Candidate(
                effects=found[i].effects,
                hypothesis=found[i],
                error=error_of(trials, trials.theta(fit.z, fit.free), fit.num_used, fit.pull),
                score_z=float(scores[i]),
                log_evidence=float(evidence[i]),
                probability=float(probability[i]),
                p_value=None,
                confounded_with=(),
            )
        )
    return tuple(made)


def _odds(trials: Trials, hypothesis: Hypothesis) -> float:
    """Of a set of effects, as far as the clip leads to expect them: of the likeliest."""
    problem = trials.problems[0]
    theta = trials.of_clip(trials.theta(hypothesis.fit.z, hypothesis.fit.free), 0)
    named = dict(zip(problem.model.names, theta, strict=True))
    scene = problem.model.scene.surroundings
    effects = [e for e in problem.model.effects if e.name in hypothesis.effects]
    return max(effect.odds(named, scene) for effect in effects)


def _compared(
    trials: Trials, candidates: tuple[Candidate, ...], seed: int
) -> tuple[tuple[Candidate, ...], dict[tuple[str, ...], Comparison]]:
    """The best candidates with their p-values and with whom they are confounded."""
    compared, done = {}, []
    top = candidates[0].log_evidence
    first = {candidates[0].name, *[c.name for c in candidates if not c.is_form][:1]}
    for i, candidate in enumerate(candidates):
        # The best is always looked at; others only where they could be confused with it.
        is_near = i < NUM_COMPARED and top - candidate.log_evidence < 2 * DECISIVE
        if candidate.name in first or is_near:
            found = compare(trials, candidate.hypothesis.fit, seed)
            compared[candidate.effects] = found
            candidate = replace(candidate, p_value=found.p_value)
        done.append(candidate)
    names = {c.effects: _rivals(c, done) for c in done}
    return tuple(replace(c, confounded_with=names[c.effects]) for c in done), compared


def _pairs(trials: Trials, best: Candidate, others: Sequence[str]) -> list[tuple[str, ...]]:
    """The best with each of those others whose score stands out most."""
    pairs = [(*best.effects, name) for name in others]
    order = np.argsort(-score_tests(trials, best.hypothesis, pairs))
    return [pairs[i] for i in order[:NUM_JOINED]]


def _rivals(candidate: Candidate, all_of: Sequence[Candidate]) -> tuple[str, ...]:
    """Candidates that explain the data as well as this one."""
    if candidate.p_value is None:
        return ()
    return tuple(
        other.name
        for other in all_of
        if other.effects != candidate.effects
        and other.p_value is not None
        and abs(other.log_evidence - candidate.log_evidence) < DECISIVE
    )


def _verdict(candidates: Sequence[Candidate], base: GradientFit, decisive: float) -> Verdict | None:
    """Named or ambiguous, or unknown where only a form will do; None where nothing does."""
    if candidates[0].log_evidence < 0:
        return None
    compared = [c for c in candidates if c.p_value is not None]
    names = [c for c in compared if not c.is_form and _explains(c, base)]
    # A form can bend to much; where it leaves something over, as where engines differ, it is none.
    forms = [c for c in compared if c.is_form and (c.p_value or 0.0) >= ADEQUATE_P]
    top = max((c.log_evidence for c in names), default=-np.inf)
    if forms and forms[0].log_evidence - top > decisive:
        return Verdict("unknown", (), forms[0].name)
    best = next((c.log_evidence for c in candidates if not c.is_form), -np.inf)
    if not names or best - top > decisive:
        return None
    equal = [c.name for c in names if top - c.log_evidence < decisive]
    alike = [c.name for c in forms if abs(top - c.log_evidence) < decisive]
    if len(equal) == 1 and not alike:
        return Verdict("named", next(c.effects for c in names if c.name == equal[0]))
    return Verdict("ambiguous", (*equal, *alike[:1]))


def _explains(candidate: Candidate, base: GradientFit) -> bool:
    """Whether what a candidate leaves unexplained does not matter."""
    assert candidate.p_value is not None
    if candidate.p_value >= EXPLAINS_P:
        return True
    fit = candidate.hypothesis.fit
    left, before = (f.chi2 / f.num_values - 1.0 for f in (fit, base))
    return before > 0 and left < LEFT_SHARE * before
