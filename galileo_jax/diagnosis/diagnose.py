"""The loop: compare, ask which effect is missing, add it, and watch the error fall.

1. Fit the model without effects; compare it with the data. Where nothing moves, that is all.
2. Search for every effect of the library beside it, and for the forms without a physical name
   (`galileo_jax.search`, `model/effects/forms`). Rank all by log odds: the evidence, which charges
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

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace

from galileo_jax.comparison.compare import Comparison, compare
from galileo_jax.diagnosis import reasons
from galileo_jax.diagnosis.advice import advice
from galileo_jax.diagnosis.candidates import candidate_so_far, candidates_of
from galileo_jax.diagnosis.constants_with_names import with_known_constants
from galileo_jax.diagnosis.diagnosis import (
    Candidate,
    Diagnosis,
    MissingForce,
    Reason,
    Round,
    Verdict,
)
from galileo_jax.diagnosis.each_clip import EachClip, each_clip
from galileo_jax.diagnosis.expected_evidence import expected_leads
from galileo_jax.diagnosis.imperfect_world import ImperfectWorld, imperfect_world
from galileo_jax.diagnosis.law_candidates import law_candidates, law_or
from galileo_jax.diagnosis.law_verdict import (
    best_formula,
    is_law_needed,
    joined_names,
    law_to_doubt,
    law_verdict,
    needs_laws,
)
from galileo_jax.diagnosis.leave_one_out import leave_one_out_rmse
from galileo_jax.diagnosis.missing_force import View, infer_missing_force, views_of
from galileo_jax.diagnosis.second_effect import with_second
from galileo_jax.diagnosis.stakes import VerdictStakes
from galileo_jax.diagnosis.verdict import (
    AS_EFFECTS,
    CONVINCING,
    PAIR_P,
    UNEVEN,
    best_named,
    decisive_margin,
    explains,
    form_that_leads,
    is_about_pairs,
    is_nothing_missing,
    looked_at_again,
    needs_pairs,
    pair_ahead_of_all,
    ranked,
    rivals,
    to_add,
    to_compare,
    verdict_of,
    within_luck,
    without_a_name,
)
from galileo_jax.inference.fits.gradient import Code, GradientFit, GradientFitter
from galileo_jax.inference.joint_problem import JointProblem
from galileo_jax.search.fit import best_fit
from galileo_jax.search.hypothesis import Hypothesis, reduced
from galileo_jax.search.loop import search
from galileo_jax.search.starts import beside_a_formula
from galileo_jax.search.table import Entry, Table

# By effects: the fit, and its comparison with the data.
Comparisons = dict[tuple[str, ...], tuple[GradientFit, Comparison]]


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
        still = Verdict("none", (), reasons=(reasons.nothing_moves(),))
        return Diagnosis((first,), (), still)
    table, first = _with_one_effect(fitter, none, first, seed, listener)
    rounds, candidates = [first], candidates_of(table)
    for candidate in candidates:
        on_candidate(candidate)
    if is_given:
        chosen = next(c for c in candidates if c.effects == (add,))
        rounds.append(_round_of(trials, chosen, seed, {}, listener))
    why = reasons.without_effects(first.comparison)
    if is_nothing_missing(first.comparison.is_adequate, candidates):
        why = (*why, reasons.nothing_convinces(best_named(candidates), CONVINCING))
        return Diagnosis(tuple(rounds), candidates, Verdict("none", (), reasons=why))
    compared: Comparisons = {}
    found = _concluded(table, first, candidates, compared, listener)
    verdict, candidates, rough = found.verdict, found.candidates, found.rough
    if rough is not None and verdict.status == "none":
        rounds = [Round(rough.base, rough.comparison), *rounds[1:]]
        on_round(rounds[0])
    verdict = with_known_constants(trials, verdict, candidates, seed)
    verdict = replace(verdict, reasons=(*why, *verdict.reasons))
    chosen = to_add(verdict, candidates) if add == "auto" else None
    rounds += _added(table, verdict, rough, chosen, compared, listener)
    scene = trials.problems[0].model.scene.surroundings
    verdict = replace(verdict, advice=advice(verdict, scene, len(trials.problems)))
    missing = _missing_of(table, verdict, candidates, found.views)
    left_out, each = _clip_by_clip(trials, table.base, rounds, listener)
    friction = rough.friction if rough is not None and verdict.effects in UNEVEN else ()
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


def _added(
    table: Table,
    verdict: Verdict,
    rough: ImperfectWorld | None,
    chosen: Candidate | None,
    compared: Comparisons,
    listener: _Listener,
) -> list[Round]:
    """The rounds that a verdict adds: imperfections under their name, and what is chosen."""
    rounds: list[Round] = []
    if rough is not None and verdict.effects in UNEVEN:
        rounds.append(rough.round_called(verdict.effects))
        listener.on_round(rounds[-1])
    if chosen is not None:
        known = compared if rough is None else {}
        rounds.append(_round_of(table.trials, chosen, table.seed, known, listener))
    return rounds


def _missing_of(
    table: Table, verdict: Verdict, candidates: Sequence[Candidate], views: Sequence[View]
) -> MissingForce | None:
    """The force without a form, where the verdict names nothing that stands for it."""
    if verdict.status not in ("unknown", "law"):
        return None
    formula = best_formula(candidates)
    around = formula.hypothesis if formula is not None and explains(formula) else table.base
    return infer_missing_force(table.trials, around, table.seed, views)


def _without_effects(
    fitter: GradientFitter, known: GradientFit | None, seed: int, listener: _Listener
) -> tuple[Hypothesis, Round]:
    """The model without effects, and its comparison with the data; `known`: see `diagnose`."""
    if known is None or not (known.code is Code.MISFIT or fitter.is_explained(known)):
        listener.on_stage("fitting the model without effects")
        known = best_fit(
            fitter, seed, listener.on_stage, effects=()
        )  # all valleys were not looked for
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
    """The verdict, and the world in which it is true.

    Attributes:
      verdict: without what is said of the model without effects.
      candidates: on which it is, ranked.
      views: of the missing force, where formulas were looked for.
      rough: the imperfect world; None: the exact one.
    """

    verdict: Verdict
    candidates: tuple[Candidate, ...]
    views: Sequence[View] = ()
    rough: ImperfectWorld | None = None


def _concluded(
    table: Table,
    first: Round,
    candidates: tuple[Candidate, ...],
    compared: Comparisons,
    listener: _Listener,
) -> _Conclusion:
    """What is missing, where something is.

    Args:
      table: of the search for single effects.
      first: the model without effects, compared with the data.
      candidates: of the table, ranked.
      compared: comparisons by effects; those made here are added.
      listener: told what is being done.
    """
    trials, seed, on_stage = table.trials, table.seed, listener.on_stage
    is_adequate = first.comparison.is_adequate
    decisive = decisive_margin(is_adequate)
    on_stage("comparing the best candidates with the data")
    candidates = _compared(trials, candidates, decisive, seed, compared)
    rough = None
    if not is_adequate:
        on_stage("allowing for imperfections")
        rough = imperfect_world(trials, table.base, decisive, seed)
    if rough is not None and not rough.is_beaten_by(candidates):
        rough = rough.with_candidates(trials, candidates, seed)
        verdict = _in_imperfect_world(trials, rough, on_stage)
        is_uneven = bool(set(verdict.effects) & set(AS_EFFECTS.values()))
        if verdict.status != "unknown" and not is_uneven:
            return _Conclusion(verdict, rough.with_the_rest(candidates), (), rough)
    # A pair or a formula may explain it.
    found = _searched(table, candidates, decisive, compared, listener)
    verdict, candidates = found.verdict, found.candidates
    if is_adequate or not (verdict.status in ("unknown", "law") or is_about_pairs(verdict)):
        rough = None
    else:
        rough, verdict = _instead(trials, rough, verdict, candidates, seed, on_stage)
    if rough is not None:
        candidates = rough.with_the_rest(candidates)
    verdict = replace(verdict, reasons=(*found.reasons, *verdict.reasons))
    return _Conclusion(verdict, candidates, found.views, rough)


def _round_of(
    trials: JointProblem,
    chosen: Candidate,
    seed: int,
    compared: Comparisons,
    listener: _Listener,
) -> Round:
    """A candidate as it is added to the model, compared with the data."""
    fit, comparison = compared.get(chosen.effects, (None, None))
    if comparison is None or fit is not chosen.hypothesis.fit:
        comparison = compare(chosen.hypothesis.of(trials), chosen.hypothesis.fit, seed)
    added = Round(chosen.hypothesis, comparison)
    listener.on_round(added)
    return added


def _clip_by_clip(
    trials: JointProblem, base: Hypothesis, rounds: Sequence[Round], listener: _Listener
) -> tuple[tuple[tuple[str, float, float], ...], tuple[EachClip, ...]]:
    """How each clip is predicted from the others, and what it is by itself; none of one clip."""
    if len(trials.problems) == 1:
        return (), ()
    left_out: tuple[tuple[str, float, float], ...] = ()
    if len(rounds) > 1:
        listener.on_stage("predicting each clip from the others")
        before, after = (
            leave_one_out_rmse(one.hypothesis.of(trials), one.hypothesis)
            for one in (rounds[0], rounds[-1])
        )
        left_out = tuple(zip((p.name for p in trials.problems), before, after, strict=True))
    listener.on_stage("looking at each clip by itself")
    return left_out, each_clip(trials, base.fit, rounds[0].comparison)


@dataclass(frozen=True)
class _Searched:
    """What pairs and formulas came to.

    Attributes:
      verdict: on the whole table.
      candidates: the table.
      views: of the missing force, where formulas were looked for.
      reasons: why pairs were tried, and what came of it.
    """

    verdict: Verdict
    candidates: tuple[Candidate, ...]
    views: list[View]
    reasons: tuple[Reason, ...]


def _searched(
    table: Table,
    candidates: tuple[Candidate, ...],
    decisive: float,
    compared: Comparisons,
    listener: _Listener,
) -> _Searched:
    """Pairs and, where these or what they say is not enough, formulas, in an exact world.

    Args:
      table: of the search for single effects.
      candidates: these, ranked, compared with the data.
      decisive: nats by which one hypothesis must be ahead of another.
      compared: comparisons by effects; those made here are added.
      listener: told what is being done and found.
    """
    trials, seed = table.trials, table.seed
    on_stage, on_entry = listener.on_stage, listener.on_entry
    single, form = best_named(candidates), form_that_leads(candidates)
    is_needed = needs_pairs(candidates)
    on_stage("fitting pairs of effects")
    table = search(table, 2, on_entry)
    for candidate in candidates_of(table):
        listener.on_candidate(candidate)
    on_stage("comparing the best pairs with the data")
    candidates = _compared(trials, candidates_of(table), decisive, seed, compared)
    why = _why_pairs(table, candidates, single, form if is_needed else None, is_needed)
    verdict = _judged(trials, candidates, decisive, on_stage)
    views: list[View] = []
    if needs_laws(verdict, candidates):
        on_stage("inferring the missing force")
        # Where much is missing, friction without it is far from the truth: to 0, say. Beside a
        # wrong effect it may be so, too.
        start = reduced(trials, candidates[0].hypothesis, ())
        views = views_of(trials, start, table.base)
        on_stage("looking for a law: comparing formulas with the missing force")
        num = len(table.library)
        laws = law_candidates(trials, table.base, start, views, num, candidates, on_stage)
        for candidate in ranked(laws):
            listener.on_candidate(candidate)
        both = _compared(trials, (*candidates, *laws), decisive, seed, compared)
        law = law_to_doubt(both)
        if law is not None:
            on_stage("fitting the library's effects again, starting from the law")
            beside = beside_a_formula(table, law.hypothesis)
            again = search(table, 1, on_entry, beside)
            if again.is_better_than(table):
                candidates = _compared(trials, candidates_of(again), decisive, seed, compared)
                both = _compared(trials, (*candidates, *laws), decisive, seed, compared)
                verdict = _judged(trials, candidates, decisive, on_stage)
                table = again
        if law is None or is_law_needed(verdict, candidates, law, decisive):
            candidates, verdict = both, law_or(trials, verdict, both, decisive)
        else:
            why = [*why, reasons.library_says_it(best_named(candidates), law)]
        verdict = _or_pair(trials, verdict, candidates, decisive, on_stage)
    log_odds = {key: table.log_odds(entry.hypothesis) for key, entry in table.entries.items()}
    verdict = with_second(verdict, candidates, log_odds)
    return _Searched(verdict, candidates, views, tuple(why))


def _why_pairs(
    table: Table,
    candidates: Sequence[Candidate],
    single: Candidate,
    form: Candidate | None,
    is_needed: bool,
) -> list[Reason]:
    """Why pairs were tried, and what came of it.

    Args:
      table: with pairs.
      candidates: with those that count.
      single: the best single effect.
      form: that explains the data better.
      is_needed: whether no single effect explains the data, or a form does it better.
    """
    pairs = table.named(2)
    if not pairs:
        return []
    if is_needed:
        return [reasons.pairs_tried(single, form, len(pairs))]
    contesting = [c for c in candidates if len(c.effects) == 2]
    if contesting:
        return [reasons.pairs_beside(single, len(pairs), len(contesting))]
    first = max(pairs, key=table.log_odds)
    behind = single.log_odds - table.log_odds(first)
    return [reasons.no_pair_contests(single, "+".join(first.effects), behind, len(pairs))]


def _in_imperfect_world(
    trials: JointProblem, rough: ImperfectWorld, on_stage: Callable[[str], None]
) -> Verdict:
    """The verdict on a table of hypotheses with imperfections."""
    plain = without_a_name(rough.comparison, rough.table, is_friction=rough.pushing is None)
    if plain is not None:
        return plain
    law = law_verdict(rough.table, rough.decisive)
    if law is not None:
        return law
    found = _judged(trials, rough.table, rough.decisive, on_stage)
    is_law = {c.name for c in rough.table if c.law is not None}
    is_named = not is_law & set(joined_names(found))
    return found if is_named else Verdict("unknown", (), reasons=found.reasons)


def _instead(
    trials: JointProblem,
    rough: ImperfectWorld | None,
    verdict: Verdict,
    candidates: Sequence[Candidate],
    seed: int,
    on_stage: Callable[[str], None],
) -> tuple[ImperfectWorld | None, Verdict]:
    """Another verdict where imperfections explain the data as well as what it is about.

    Args:
      trials: what was diagnosed.
      rough: as far as it is known.
      verdict: in the exact world.
      candidates: on which it is, ranked.
      seed: of the replicates.
      on_stage: told what is being done.

    Returns:
      The imperfect world, None where the verdict stands in the exact one; and the verdict.
    """
    if rough is None:
        return None, verdict
    on_stage("allowing for imperfections")
    rough = rough.with_candidates(trials, candidates, seed)
    other = _in_imperfect_world(trials, rough, on_stage)
    if other.status in ("none", "named", "ambiguous") and other.effects != verdict.effects:
        return rough, other
    if verdict.status == "unknown":
        said = reasons.imperfections_fail(rough.comparison, rough.pushing)
        return None, replace(verdict, reasons=(*verdict.reasons, said))
    return None, verdict


def is_any_moving(trials: JointProblem) -> bool:
    """Whether any object is seen to leave where it stood."""
    return any(
        problem.observation.first_away(index) is not None
        for problem in trials.problems
        for index in range(len(problem.observation.names))
    )


def _judged(
    trials: JointProblem,
    candidates: Sequence[Candidate],
    decisive: float,
    on_stage: Callable[[str], None],
) -> Verdict:
    """The verdict on a table without laws; what is named was looked at again."""
    verdict = verdict_of(candidates, decisive)
    if verdict.status != "named":
        return verdict
    return _looked_at(trials, verdict, candidates, decisive, on_stage)


def _or_pair(
    trials: JointProblem,
    verdict: Verdict,
    candidates: Sequence[Candidate],
    decisive: float,
    on_stage: Callable[[str], None],
) -> Verdict:
    """A pair in place of unknown, where it is ahead of all that was tried, formulas among it."""
    pair = pair_ahead_of_all(candidates, decisive) if verdict.status == "unknown" else None
    if pair is None:
        return verdict
    why = reasons.explains(pair), reasons.pair_ahead(pair, PAIR_P)
    named = Verdict("named", pair.effects, reasons=why)
    return _looked_at(trials, named, candidates, decisive, on_stage)


def _looked_at(
    trials: JointProblem,
    verdict: Verdict,
    candidates: Sequence[Candidate],
    decisive: float,
    on_stage: Callable[[str], None],
) -> Verdict:
    """A named verdict, if a clip like this one tells it from what could be confused with it."""
    on_stage("looking at what could be confused with it")
    named = next(c for c in candidates if c.effects == verdict.effects)
    alike = within_luck(named, candidates, decisive)
    leads = expected_leads(trials, named, alike)
    return looked_at_again(verdict, named, list(zip(alike, leads, strict=True)), decisive)


def _compared(
    trials: JointProblem,
    candidates: Iterable[Candidate],
    decisive: float,
    seed: int,
    compared: Comparisons,
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
        fit = c.hypothesis.fit
        if c.effects not in compared or compared[c.effects][0] is not fit:
            compared[c.effects] = fit, compare(c.hypothesis.of(trials), fit, seed)
    done = [
        replace(c, p_value=compared[c.effects][1].p_value)
        if c.effects in compared and compared[c.effects][0] is c.hypothesis.fit
        else c
        for c in table
    ]
    return tuple(replace(c, confounded_with=rivals(c, done)) for c in done)
