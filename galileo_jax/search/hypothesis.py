"""A hypothesis: a set of effects, and the fit of the model with them."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from galileo_jax.inference.fits.gradient import GradientFit
from galileo_jax.inference.joint_problem import JointProblem


@dataclass(frozen=True, eq=False)
class Hypothesis:
    """Effects that are there, and the fit with them."""

    effects: tuple[str, ...]  # names, in the order in which they were added
    fit: GradientFit  # of all parameters
    # whose parameters these are, where not the diagnosis's own: of a law
    trials: JointProblem | None = None

    @property
    def key(self) -> frozenset[str]:
        """The effects in no order: what makes two hypotheses one."""
        return frozenset(self.effects)

    def of(self, trials: JointProblem) -> JointProblem:
        """The trials that it was fitted to, where the diagnosis's own are `trials`."""
        return self.trials or trials

    def evidence_over(self, base: "Hypothesis") -> float:
        """Log evidence less that of another, nats."""
        return self.fit.log_evidence - base.fit.log_evidence

    @property
    def misfit(self) -> float:
        """By how much chi2 per measured value exceeds 1, which noise alone would give."""
        return self.fit.chi2 / self.fit.num_values - 1.0


def reduced(trials: JointProblem, hypothesis: Hypothesis, effects: Sequence[str]) -> Hypothesis:
    """A hypothesis with only some of its effects, all else as it is: to start from, not a fit."""
    fit, free = hypothesis.fit, trials.free(effects)
    return Hypothesis(tuple(effects), replace(fit, z=np.where(free, fit.z, 0.0), free=free))
