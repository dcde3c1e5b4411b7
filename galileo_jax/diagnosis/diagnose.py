"""The loop: compare, ask which effect is missing, add it, and watch the error fall.

1. Fit the model without effects; compare it with the data. Where nothing moves, that is all.
2. Search for every effect of the library beside it, and for the forms without a physical name
   (`galileo_jax.search`, `effects/forms.py`). Rank all by log odds: the evidence, which charges
   for every parameter, and the prior, which charges for how many were tried. The model without
   effects will do and nothing convinces: the verdict is none.
3. Compare the best with the data, too. Where none leaves only noise, it is asked whether
   imperfections of usual sizes, with no effect or with one, explain the data (`imperfect_world`).
4. Search for pairs in the same table (rules: `verdict`, `law_verdict`). They and formulas must beat
   imperfections.
5. What leaves only noise and is far more probable than all else is named, unless a clip like this
   one would not tell it from another (`expected_lead`). Several are ambiguous.
6. Where only a form explains the data, or nothing does, or only what could explain much (two
   effects, or one of many constants), the missing force is inferred without a form
   (`missing_force`). Short formulas that it suggests are fitted in the model (`laws`) and
   stand in the same table. The verdict is law where one does what a named effect must, and no
   effect of the library, searched for again from there, says it as well; else it is unknown.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

from galileo_jax.comparison.compare import compare
from galileo_jax.diagnosis import reasons
from galileo_jax.diagnosis.advice import advice
from galileo_jax.diagnosis.candidates import candidate_so_far, candidates_of, law_candidates
from galileo_jax.diagnosis.diagnosis import (
    Candidate,
    Diagnosis,
    MissingForce,
    Reason,
    Round,
    Verdict,
)
from galileo_jax.diagnosis.each_clip import EachClip, each_clip, leave_one_out_rmse
from galileo_jax.diagnosis.imperfect_world import ImperfectWorld, imperfect_world
from galileo_jax.diagnosis.judge import Judge
from galileo_jax.diagnosis.law_verdict import best_formula, is_law_needed, law_to_doubt, needs_laws
from galileo_jax.diagnosis.missing_force import View, infer_missing_force, views_of
from galileo_jax.diagnosis.reasons import because
from galileo_jax.diagnosis.remarks import with_known_constants, with_second
from galileo_jax.diagnosis.stakes import VerdictStakes, decisive_margin
from galileo_jax.diagnosis.thresholds import CONVINCING
from galileo_jax.diagnosis.verdict import (
    AS_EFFECTS,
    UNEVEN,
    best_named,
    explains,
    form_that_leads,
    is_about_pairs,
    is_nothing_missing,
    needs_pairs,
    ranked,
    to_add,
)
from galileo_jax.inference.fits.gradient import Code, GradientFit, GradientFitter
from galileo_jax.inference.joint_problem import JointProblem
from galileo_jax.observation.observation import AWAY_M, AWAY_SD
from galileo_jax.search.fit import best_fit
from galileo_jax.search.hypothesis import Hypothesis, reduced
from galileo_jax.search.loop import search
from galileo_jax.search.starts import beside_a_formula
from galileo_jax.search.table import Entry, Table


def diagnose(
    trials: JointProblem,
    *,
    seed: int = 0,
    add: str = "auto",
    base: GradientFit | None = None,
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
      base: of the model without effects, in an exact world, where that was fitted before.
      on_stage: told what is being done.
      on_round: called with each round of the loop.
      on_candidate: called with each candidate as soon as it is fitted, and once more with each in
        the end, the best first: until then fits may get better, and probabilities change.

    Raises:
      ValueError: `add` names no effect of the trials' models.
    """
    if is_given := add not in ("auto", "none"):
        trials.free([add])  # raises for unknown names
    listener, fitter = _Listener(on_stage, on_round, on_candidate), GradientFitter(trials)
    none, first = _without_effects(fitter, base, seed, listener)
    if not is_given and not is_any_moving(trials):
        why = because("nothing_moves", least_sds=AWAY_SD, least_m=AWAY_M)
        return Diagnosis((first,), (), Verdict("none", (), reasons=(why,)))
    table, first = _with_one_effect(fitter, none, first, seed, listener)
    is_adequate = first.comparison.is_adequate
    judge = Judge(trials, decisive_margin(is_adequate), seed, on_stage)
    rounds, candidates = [first], listener.on_table(table)
    if is_given:
        chosen = next(c for c in candidates if c.effects == (add,))
        alone = replace(judge, comparisons={})  # of no table
        rounds.append(_round_of(alone, chosen.hypothesis, listener))
    why = reasons.without_effects(first.comparison)
    if is_nothing_missing(is_adequate, candidates):
        best = best_named(candidates)
        unconvincing = because("nothing_convinces", best, least_log_odds=CONVINCING)
        none_missing = Verdict("none", (), reasons=(*why, unconvincing))
        return Diagnosis(tuple(rounds), candidates, none_missing)
    found = _concluded(table, judge, is_adequate, candidates, listener)
    verdict, candidates, rough = found.verdict, found.candidates, found.rough
    if rough is not None and verdict.status == "none":
        rounds = [Round(rough.base, rough.comparison), *rounds[1:]]
        on_round(rounds[0])
    verdict = with_known_constants(trials, verdict, candidates, seed)
    verdict = replace(verdict, reasons=(*why, *verdict.reasons))
    is_uneven = rough is not None and verdict.effects in UNEVEN
    if rough is not None and is_uneven:
        rounds.append(rough.round_called(verdict.effects))
        on_round(rounds[-1])
    if add == "auto" and (chosen := to_add(verdict, candidates)) is not None:
        rounds.append(_round_of(judge, chosen.hypothesis, listener))
    scene = trials.problems[0].model.scene.surroundings
    verdict = replace(verdict, advice=advice(verdict, scene, len(trials.problems)))
    missing = _missing_of(table, verdict, candidates, found.views)
    left_out, each = _clip_by_clip(trials, table.base, rounds, listener)
    friction = rough.friction if rough is not None and is_uneven else ()
    return Diagnosis(tuple(rounds), candidates, verdict, missing, left_out, each, friction)


@dataclass(frozen=True)
class _Listener:
    """Who is told of what is done and found, see `diagnose`."""

    on_stage: Callable[[str], None]
    on_round: Callable[[Round], None]
    on_candidate: Callable[[Candidate], None]

    def on_entry(self, table: Table, entry: Entry) -> None:
        """Tells of a row of a search."""
        self.on_candidate(candidate_so_far(table, entry))

    def on_table(self, table: Table) -> tuple[Candidate, ...]:
        """Tells of all rows of a search, the best first, and returns them."""
        candidates = candidates_of(table)
        for candidate in candidates:
            self.on_candidate(candidate)
        return candidates


def is_any_moving(trials: JointProblem) -> bool:
    """Whether any object is seen to leave where it stood."""
    return any(
        problem.observation.first_away(index) is not None
        for problem in trials.problems
        for index in range(len(problem.observation.names))
    )


def _without_effects(
    fitter: GradientFitter, known: GradientFit | None, seed: int, listener: _Listener
) -> tuple[Hypothesis, Round]:
    """The model without effects, and its comparison with the data; `known`: see `diagnose`."""
    if known is None or not (known.code is Code.MISFIT or fitter.is_explained(known)):
        listener.on_stage("fitting the model without effects")
        # Not all valleys of `known` were looked for.
        known = best_fit(fitter, seed, listener.on_stage, effects=())
    base = Hypothesis((), known)
    listener.on_stage("comparing it with the data")
    first = Round(base, compare(fitter.trials, base.fit, seed))
    listener.on_round(first)
    return base, first


def _with_one_effect(
    fitter: GradientFitter, base: Hypothesis, first: Round, seed: int, listener: _Listener
) -> tuple[Table, Round]:
    """The table of single effects; the first round again, if its model was fitted better."""
    trials = fitter.trials
    stakes = VerdictStakes(trials, first.comparison.is_adequate)
    table = Table.of(fitter, stakes, seed, base)
    listener.on_stage(f"fitting {len(table.library)} candidates")
    table = search(table, 1, listener.on_entry)
    if table.base.fit is base.fit:
        return table, first
    listener.on_stage("comparing a better fit without effects with the data")
    first = Round(table.base, compare(trials, table.base.fit, seed))
    listener.on_round(first)
    stakes = VerdictStakes(trials, first.comparison.is_adequate)
    return search(replace(table, stakes=stakes), 1, listener.on_entry), first


@dataclass(frozen=True)
class _Conclusion:
    """The verdict, and the world in which it is true."""

    verdict: Verdict  # without what is said of the model without effects
    candidates: tuple[Candidate, ...]  # on which it is, ranked
    views: Sequence[View] = ()  # of the missing force, where formulas were looked for
    rough: ImperfectWorld | None = None  # None: the exact world


def _concluded(
    table: Table,
    judge: Judge,
    is_adequate: bool,
    candidates: tuple[Candidate, ...],
    listener: _Listener,
) -> _Conclusion:
    """What is missing, where something is; `is_adequate`: the model without effects."""
    judge.on_stage("comparing the best candidates with the data")
    candidates = judge.compared(candidates)
    rough = settled = None
    if not is_adequate:
        judge.on_stage("allowing for imperfections")
        rough = imperfect_world(judge, table.base)
    if rough is not None and not rough.is_beaten_by(candidates):
        rough = rough.with_candidates(candidates)
        settled = _settled(rough, candidates)
    if settled is not None and not settled.verdict.effects:
        return settled
    judge.on_stage("fitting pairs of effects")
    table = search(table, 2, listener.on_entry)
    if settled is not None and rough is not None and not rough.is_contested_by(table):
        return settled
    # A pair or a formula may explain it.
    why, found = _searched(table, judge, candidates, listener)
    verdict, candidates = found.verdict, found.candidates
    if is_adequate or not (verdict.status in ("unknown", "law") or is_about_pairs(verdict)):
        rough = None
    if rough is not None:
        rough, verdict = _instead(rough, verdict, candidates)
    if rough is not None:
        candidates = rough.with_the_rest(candidates)
    verdict = replace(verdict, reasons=(*why, *verdict.reasons))
    return _Conclusion(verdict, candidates, found.views, rough)


def _settled(rough: ImperfectWorld, candidates: Sequence[Candidate]) -> _Conclusion | None:
    """What is missing in an imperfect world; None where formulas may be needed to tell."""
    verdict = rough.verdict()
    is_uneven = bool(set(verdict.effects) & set(AS_EFFECTS.values()))
    if verdict.status == "unknown" or is_uneven:
        return None
    return _Conclusion(verdict, rough.with_the_rest(candidates), rough=rough)


def _searched(
    table: Table, judge: Judge, candidates: tuple[Candidate, ...], listener: _Listener
) -> tuple[list[Reason], _Conclusion]:
    """Pairs and, where these or what they say is not enough, formulas, in an exact world.

    `candidates` are those of single effects, compared with the data; the table has pairs, too. Why
    these were tried, and what came of it, is said beside the conclusion.
    """
    singles = candidates
    candidates = listener.on_table(table)
    judge.on_stage("comparing the best pairs with the data")
    candidates = judge.compared(candidates)
    why = _why_pairs(table, candidates, singles)
    verdict = judge.verdict(candidates)
    views: list[View] = []
    if needs_laws(verdict, candidates):
        judge.on_stage("inferring the missing force")
        # Where much is missing, friction without it is far from the truth: to 0, say. Beside a
        # wrong effect it may be so, too.
        start = reduced(judge.trials, candidates[0].hypothesis, ())
        views = views_of(judge.trials, start, table.base)
        judge.on_stage("looking for a law: comparing formulas with the missing force")
        laws = law_candidates(table, start, views, candidates, judge.on_stage)
        for candidate in ranked(laws):
            listener.on_candidate(candidate)
        both = judge.compared((*candidates, *laws))
        law = law_to_doubt(both)
        if law is not None:
            judge.on_stage("fitting the library's effects again, starting from the law")
            beside = beside_a_formula(table, law.hypothesis)
            again = search(table, 1, listener.on_entry, beside)
            if again.is_better_than(table):
                table, candidates = again, judge.compared(candidates_of(again))
                both = judge.compared((*candidates, *laws))
                verdict = judge.verdict(candidates)
        if law is None or is_law_needed(verdict, candidates, law, judge.decisive):
            candidates, verdict = both, judge.or_law(verdict, both)
        else:
            best = best_named(candidates)
            ahead = best.log_odds - law.log_odds
            why.append(because("library_says_it", best, law, log_odds_behind=ahead))
        verdict = judge.or_pair(verdict, candidates)
    log_odds = {key: table.log_odds(entry.hypothesis) for key, entry in table.entries.items()}
    verdict = with_second(verdict, candidates, log_odds)
    return why, _Conclusion(verdict, candidates, views)


def _why_pairs(
    table: Table, candidates: Sequence[Candidate], singles: Sequence[Candidate]
) -> list[Reason]:
    """Why pairs were tried, and what came of it."""
    single, form, pairs = best_named(singles), form_that_leads(singles), table.named(2)
    if not pairs:
        return []
    if needs_pairs(singles):
        rule, words = ("pairs_tried:form", {"form": form.title}) if form else ("pairs_tried", {})
        numbers = {"num_pairs": len(pairs), "p_value": single.p_value}
        return [because(rule, single, words=words, **numbers)]
    if num := sum(len(c.effects) == 2 for c in candidates):
        return [because("pairs_beside", single, num_near=len(pairs), num_pairs=num)]
    first = max(pairs, key=table.log_odds)
    numbers = {
        "rival": "+".join(first.effects),
        "log_odds_behind": single.log_odds - table.log_odds(first),
        "num_near": len(pairs),
    }
    return [because("no_pair_contests", single, **numbers)]


def _instead(
    rough: ImperfectWorld, verdict: Verdict, candidates: Sequence[Candidate]
) -> tuple[ImperfectWorld | None, Verdict]:
    """Another verdict where imperfections explain the data as well as what it is about.

    With it the imperfect world; None where the verdict stands in the exact one.
    """
    rough.judge.on_stage("allowing for imperfections")
    rough = rough.with_candidates(candidates)
    other = rough.verdict()
    if other.status in ("none", "named", "ambiguous") and other.effects != verdict.effects:
        return rough, other
    if verdict.status == "unknown":
        said = reasons.imperfections_fail(rough.comparison, rough.pushing)
        return None, replace(verdict, reasons=(*verdict.reasons, said))
    return None, verdict


def _round_of(judge: Judge, hypothesis: Hypothesis, listener: _Listener) -> Round:
    """A hypothesis as it is added to the model, compared with the data."""
    added = Round(hypothesis, judge.comparison(hypothesis))
    listener.on_round(added)
    return added


def _missing_of(
    table: Table, verdict: Verdict, candidates: Sequence[Candidate], views: Sequence[View]
) -> MissingForce | None:
    """The force without a form, where the verdict names nothing that stands for it."""
    if verdict.status not in ("unknown", "law"):
        return None
    formula = best_formula(candidates)
    around = formula.hypothesis if formula is not None and explains(formula) else table.base
    return infer_missing_force(table.trials, around, table.seed, views)


def _clip_by_clip(
    trials: JointProblem, base: Hypothesis, rounds: Sequence[Round], listener: _Listener
) -> tuple[tuple[tuple[str, float, float], ...], tuple[EachClip, ...]]:
    """How each clip is predicted from the others, and what it is by itself; none of one clip."""
    if len(trials.problems) == 1:
        return (), ()
    left_out: tuple[tuple[str, float, float], ...] = ()
    if len(rounds) > 1:
        listener.on_stage("predicting each clip from the others")
        before, after = (leave_one_out_rmse(trials, rounds[i].hypothesis) for i in (0, -1))
        left_out = tuple(zip((p.name for p in trials.problems), before, after, strict=True))
    listener.on_stage("looking at each clip by itself")
    return left_out, each_clip(trials, base.fit, rounds[0].comparison)
