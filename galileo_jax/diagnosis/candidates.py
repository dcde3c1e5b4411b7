"""Hypotheses as candidates of a verdict: those of a search, and formulas."""

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from galileo_jax.diagnosis.diagnosis import Candidate, Law
from galileo_jax.diagnosis.law_verdict import law_odds
from galileo_jax.diagnosis.laws.fit_formulas import fitted_laws
from galileo_jax.diagnosis.missing_force import View
from galileo_jax.diagnosis.stakes import (
    log_prior,
    num_constants,
    num_expected,
    odds_of,
    without_surplus,
)
from galileo_jax.diagnosis.thresholds import INCREDIBLE_SDS
from galileo_jax.diagnosis.verdict import ranked
from galileo_jax.inference.fits.gradient import GradientFit
from galileo_jax.inference.joint_problem import JointProblem
from galileo_jax.inference.result import error_of
from galileo_jax.model.effects.forms import FORM_BY_NAME
from galileo_jax.search.hypothesis import Hypothesis
from galileo_jax.search.table import Entry, Table


def candidates_of(table: Table) -> tuple[Candidate, ...]:
    """The rows of a search, whose stakes are the verdict's, ranked."""
    return ranked(without_surplus([candidate_of(table, entry) for entry in table.best_first]))


def candidate_so_far(table: Table, entry: Entry) -> Candidate:
    """One row of the table, with its probability among all that was fitted so far."""
    log_odds = [table.log_odds(other.hypothesis) for other in table.best_first]
    total = float(np.logaddexp.reduce([0.0, *log_odds]))
    candidate = candidate_of(table, entry)
    return replace(candidate, probability=float(np.exp(candidate.log_odds - total)))


def candidate_of(table: Table, entry: Entry) -> Candidate:
    """One row of the table; its probability, which depends on the others, is 0."""
    trials, hypothesis = table.trials, entry.hypothesis
    return Candidate(
        effects=hypothesis.effects,
        hypothesis=hypothesis,
        error=error_left(trials, hypothesis.fit),
        score_z=entry.score_z,
        log_evidence=hypothesis.evidence_over(table.base),
        log_prior=table.stakes.log_prior(hypothesis),
        num_constants=num_constants(trials, hypothesis),
        num_expected=num_expected(odds_of(trials, hypothesis)),
        unusual=incredible(trials, hypothesis),
    )


def incredible(trials: JointProblem, hypothesis: Hypothesis) -> tuple[str, ...]:
    """The effects' parameters whose values nobody would believe, whatever the data say."""
    fit = hypothesis.fit
    is_far = fit.free & (np.abs(fit.z) > INCREDIBLE_SDS)
    chosen = [trials.parameters[i] for i in np.flatnonzero(is_far)]
    return tuple(one.name for one in chosen if one.role == "effect")


def law_candidates(
    table: Table,
    near: Hypothesis,
    views: Sequence[View],
    fitted: Sequence[Candidate],
    on_stage: Callable[[str], None] = lambda _: None,
) -> list[Candidate]:
    """Formulas that the missing force suggests, fitted in the model.

    `near` has no effects, all else as in the hypothesis of `views`. The formula of the best form
    among the ranked `fitted` is tried, too, with its constants free.
    """
    made = []
    forms = [FORM_BY_NAME[c.effects[0]] for c in fitted[:1] if c.family is not None]
    wanted = [(form.family, form.nature, form.is_on_all) for form in forms]
    for law in fitted_laws(table.trials, near, views, wanted, on_stage):
        values = {name: f"{value:.4g}" for name, value in law.constants().items()}
        odds = law_odds(len(law.structure.factors))
        made.append(
            Candidate(
                effects=law.hypothesis.effects,
                hypothesis=law.hypothesis,
                error=error_left(law.trials, law.hypothesis.fit),
                score_z=float(np.sqrt(2 * max(law.score, 0.0))),
                log_evidence=law.hypothesis.evidence_over(table.base),
                log_prior=log_prior([odds], len(table.library)),
                law=Law(law.text, law.structure.family, law.source, values),
                num_constants=len(values),
            )
        )
    return made


def error_left(trials: JointProblem, fit: GradientFit) -> dict[str, float]:
    """What a fit leaves of the data, as in result.json."""
    return error_of(trials, trials.theta(fit.z, fit.free), fit.num_fitted, fit.pull)
