"""What hangs on a hypothesis of a diagnosis: see `galileo_jax.search.table.Stakes`."""

from dataclasses import dataclass

import numpy as np

from galileo_jax.diagnosis.verdict import (
    decisive_margin,
    log_prior,
    may_decide,
    num_expected,
)
from galileo_jax.inference.joint_problem import JointProblem
from galileo_jax.model.effects.effect import Effect
from galileo_jax.model.effects.forms import FORM_NAMES
from galileo_jax.search.hypothesis import Hypothesis
from galileo_jax.search.table import Stakes


@dataclass(frozen=True)
class VerdictStakes(Stakes):
    """The rules of the verdict, for a search.

    Attributes:
      trials: what is diagnosed.
      is_adequate: whether the model without effects leaves nothing but noise.
    """

    trials: JointProblem
    is_adequate: bool

    @property
    def decisive(self) -> float:
        """Nats by which one hypothesis must be ahead of another."""
        return decisive_margin(self.is_adequate)

    def log_prior(self, hypothesis: Hypothesis) -> float:
        """Log of its probability before the data over that of the model without effects."""
        library = [name for name in self.trials.all_effects if name not in FORM_NAMES]
        return log_prior(odds_of(self.trials, hypothesis), len(library))

    def may_decide(
        self, log_odds: np.ndarray, is_form: np.ndarray, num_effects: np.ndarray
    ) -> np.ndarray:
        """See `verdict.may_decide`."""
        return may_decide(log_odds, is_form, num_effects, self.decisive, self.is_adequate)


def odds_of(trials: JointProblem, hypothesis: Hypothesis) -> list[float]:
    """Of each effect of a hypothesis, as far as the clip leads to expect it."""
    problem = trials.problems[0]
    theta = trials.of_clip(trials.theta(hypothesis.fit.z, hypothesis.fit.free), 0)
    named = dict(zip(problem.model.names, theta, strict=True))
    scene = problem.model.scene.surroundings
    return [effect.odds(named, scene) for effect in _effects(trials, hypothesis)]


def num_constants(trials: JointProblem, hypothesis: Hypothesis) -> int:
    """Parameters of its effects, in one clip."""
    scene = trials.problems[0].model.scene.surroundings
    return sum(len(effect.parameters(scene)) for effect in _effects(trials, hypothesis))


def expected_effects(trials: JointProblem, hypothesis: Hypothesis) -> int:
    """How many of its effects the clip leads to expect."""
    return num_expected(odds_of(trials, hypothesis))


def _effects(trials: JointProblem, hypothesis: Hypothesis) -> list[Effect]:
    effects = trials.problems[0].model.effects
    return [effect for effect in effects if effect.name in hypothesis.effects]
