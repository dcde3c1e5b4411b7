"""Formulas as candidates, and the verdict that one of them is the law."""

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from galileo_jax.diagnosis.diagnosis import Candidate, Law, Verdict
from galileo_jax.diagnosis.expected_evidence import expected_leads
from galileo_jax.diagnosis.law_verdict import (
    contested_by_law,
    law_contested,
    law_odds,
    law_verdict,
    other_formulas,
)
from galileo_jax.diagnosis.laws.fit_formulas import fitted_laws
from galileo_jax.diagnosis.missing_force import View
from galileo_jax.diagnosis.verdict import log_prior, looked_at_again, within_luck
from galileo_jax.inference.joint_problem import JointProblem
from galileo_jax.inference.result import error_of
from galileo_jax.model.effects.forms import FORM_SHAPES
from galileo_jax.search.hypothesis import Hypothesis


def law_candidates(
    trials: JointProblem,
    base: Hypothesis,
    near: Hypothesis,
    views: Sequence[View],
    num_effects: int,
    fitted: Sequence[Candidate],
    on_stage: Callable[[str], None] = lambda _: None,
) -> list[Candidate]:
    """Formulas that the missing force suggests, fitted in the model.

    Args:
      trials: what was diagnosed.
      base: the model without effects, fitted to them, from which evidence counts.
      near: no effects, all else as in `views`' hypothesis.
      views: of each clip.
      num_effects: in the library.
      fitted: ranked; the formula of the best form is tried, too, with its constants free.
      on_stage: told what is being done.
    """
    made = []
    wanted = [FORM_SHAPES[c.effects[0]] for c in fitted[:1] if c.family is not None]
    for law in fitted_laws(trials, near, views, wanted, on_stage):
        fit, own = law.hypothesis.fit, law.hypothesis.of(trials)
        values = {name: f"{value:.4g}" for name, value in law.constants().items()}
        made.append(
            Candidate(
                effects=law.hypothesis.effects,
                hypothesis=law.hypothesis,
                error=error_of(own, own.theta(fit.z, fit.free), fit.num_fitted, fit.pull),
                score_z=float(np.sqrt(2 * max(law.score, 0.0))),
                log_evidence=law.hypothesis.evidence_over(base),
                log_prior=log_prior([law_odds(len(law.structure.factors))], num_effects),
                probability=0.0,
                p_value=None,
                confounded_with=(),
                law=Law(law.text, law.structure.family, law.source, values),
                num_constants=len(values),
            )
        )
    return made


def law_or(
    trials: JointProblem, before: Verdict, candidates: Sequence[Candidate], decisive: float
) -> Verdict:
    """The verdict law where a formula does what a named effect must; else as before.

    What a formula explains as well is contested.
    """
    verdict = law_verdict(candidates, decisive)
    if verdict is None:
        said = law_contested(candidates, decisive)
        after = contested_by_law(before, candidates, decisive)
        return replace(after, reasons=(*before.reasons, *said))
    best = next(c for c in candidates if c.effects == verdict.effects)
    alike = within_luck(best, other_formulas(best, candidates), decisive)
    leads = expected_leads(trials, best, alike)
    again = looked_at_again(verdict, best, list(zip(alike, leads, strict=True)), decisive)
    if again.status == "law":
        return again
    unknown = replace(before, status="unknown", effects=())
    return replace(unknown, reasons=(*before.reasons, *again.reasons))
