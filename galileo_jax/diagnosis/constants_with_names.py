"""What the data alone say of a constant that a name takes for known.

Linear drag is a drag with the power 1 of the speed. Where a clip hardly tells the power, the name
rests on what was believed before: most drags have a power with a name. Then that is said, too.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from galileo_jax.diagnosis import reasons
from galileo_jax.diagnosis.diagnosis import Candidate, Verdict
from galileo_jax.diagnosis.verdict import DECISIVE
from galileo_jax.inference.fit_posterior import fit_posterior
from galileo_jax.inference.joint_problem import JointProblem
from galileo_jax.model.effects.forms import FORMS

INTERVAL = (0.025, 0.975)  # 95 %


def with_known_constants(
    trials: JointProblem, verdict: Verdict, candidates: Sequence[Candidate], seed: int
) -> Verdict:
    """A named verdict with what the data alone say of the constant that its name takes for known.

    Args:
      trials: what the candidates were fitted to.
      verdict: any; others than named stay as they are, and so do pairs.
      candidates: all of the table.
      seed: of the draws.
    """
    if verdict.status != "named" or len(verdict.effects) != 1:
        return verdict
    name = verdict.effects[0]
    table = {c.name: c for c in candidates}
    said = []
    for form in FORMS:
        rival = table.get(form.name)
        if name not in form.named_values or rival is None:
            continue
        if table[name].log_evidence - rival.log_evidence < DECISIVE:
            draws = fit_posterior(rival.hypothesis.of(trials), rival.hypothesis.fit, seed)
            low, high = np.quantile(draws[f"{form.name}_{form.constant}"], INTERVAL).tolist()
            said.append(reasons.constant_by_data(table[name], form, low, high))
    return replace(verdict, reasons=(*verdict.reasons, *said))
