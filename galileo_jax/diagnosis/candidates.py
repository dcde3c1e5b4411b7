"""The hypotheses of a search as candidates of a verdict."""

from dataclasses import replace

import numpy as np

from galileo_jax.diagnosis.diagnosis import Candidate
from galileo_jax.diagnosis.stakes import expected_effects, num_constants
from galileo_jax.diagnosis.verdict import ranked, without_surplus
from galileo_jax.inference.result import error_of
from galileo_jax.search.table import Entry, Table


def candidates_of(table: Table) -> tuple[Candidate, ...]:
    """The candidates, ranked.

    Args:
      table: of a search, whose stakes are the verdict's.
    """
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
    fit = hypothesis.fit
    return Candidate(
        effects=hypothesis.effects,
        hypothesis=hypothesis,
        error=error_of(trials, trials.theta(fit.z, fit.free), fit.num_fitted, fit.pull),
        score_z=entry.score_z,
        log_evidence=hypothesis.evidence_over(table.base),
        log_prior=table.stakes.log_prior(hypothesis),
        probability=0.0,
        p_value=None,
        confounded_with=(),
        num_constants=num_constants(trials, hypothesis),
        num_expected=expected_effects(trials, hypothesis),
    )
