"""A hypothesis: a set of effects, and the fit of the model with them."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from galileo_jax.inference.fits.gradient import GradientFit
from galileo_jax.inference.fits.weighed import Weighed
from galileo_jax.inference.joint_problem import JointProblem

# Between Laplace's and mended evidence, nats: those of hypotheses that describe the data differ by
# up to 2.5, and alike.
ALIKE_NATS = 3.0


@dataclass(frozen=True)
class Hypothesis:
    """Effects that are there, and the fit with them.

    Attributes:
      effects: names, in the order in which they were added.
      fit: of all parameters.
      trials: whose parameters these are, where not the diagnosis's own: of a law.
      weighed: its evidence, mended; None where Laplace's has to do.
    """

    effects: tuple[str, ...]
    fit: GradientFit
    trials: JointProblem | None = None
    weighed: Weighed | None = None

    @property
    def key(self) -> frozenset[str]:
        """The effects in no order: what makes two hypotheses one."""
        return frozenset(self.effects)

    def of(self, trials: JointProblem) -> JointProblem:
        """The trials that it was fitted to, where the diagnosis's own are `trials`."""
        return self.trials or trials

    def evidence_over(self, base: "Hypothesis") -> float:
        """Log evidence less that of another, nats.

        Like with like, where only Laplace's is known: its errors are alike where hypotheses are.
        Where that of the other is off by more than such errors are (a fit far from the data has a
        bent valley), its mended evidence counts for all, so that all are measured from one place.
        """
        if base.weighed is None:
            return self.fit.log_evidence - base.fit.log_evidence
        known, mended = base.fit.log_evidence, base.weighed.log_evidence
        if self.weighed is None:
            return self.fit.log_evidence - (known if abs(known - mended) < ALIKE_NATS else mended)
        return self.weighed.log_evidence - mended

    @property
    def misfit(self) -> float:
        """By how much chi2 per measured value exceeds 1, which noise alone would give."""
        return self.fit.chi2 / self.fit.num_values - 1.0


def reduced(trials: JointProblem, hypothesis: Hypothesis, effects: Sequence[str]) -> Hypothesis:
    """A hypothesis with only some of its effects, all else as it is: to start from, not a fit."""
    fit, free = hypothesis.fit, trials.free(effects)
    return Hypothesis(tuple(effects), replace(fit, z=np.where(free, fit.z, 0.0), free=free))
