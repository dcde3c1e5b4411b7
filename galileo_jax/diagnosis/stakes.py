"""What hangs on a hypothesis of a diagnosis, and what each is worth before the data.

As the rules of `verdict`, most of these need no fit.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from math import comb, log

import numpy as np

from galileo_jax.diagnosis.diagnosis import Candidate
from galileo_jax.diagnosis.thresholds import (
    CONVINCING,
    DECISIVE,
    EXPECTED_ODDS,
    FAINT_FACTOR,
    ROUGH_NATS,
    SECOND_EFFECT_ODDS,
)
from galileo_jax.diagnosis.verdict import farthest
from galileo_jax.inference.joint_problem import JointProblem
from galileo_jax.model.effects.effect import Effect
from galileo_jax.model.effects.forms import FORM_NAMES
from galileo_jax.search.hypothesis import Hypothesis
from galileo_jax.search.loop import MAY_STILL_GAIN
from galileo_jax.search.table import Stakes


@dataclass(frozen=True)
class VerdictStakes(Stakes):
    """The rules of the verdict, for a search."""

    trials: JointProblem  # what is diagnosed
    is_adequate: bool  # whether the model without effects leaves nothing but noise

    def log_prior(self, hypothesis: Hypothesis) -> float:
        """Log of its probability before the data over that of the model without effects."""
        library = [name for name in self.trials.all_effects if name not in FORM_NAMES]
        return log_prior(odds_of(self.trials, hypothesis), len(library))

    def log_priors_beside(self, hypothesis: Hypothesis) -> dict[str, float]:
        """By each other named effect, what it adds to `log_prior` of a hypothesis beside it."""
        own = self.log_prior(hypothesis) if hypothesis.effects else 0.0
        names = set(self.trials.all_effects) - set(hypothesis.effects) - set(FORM_NAMES)
        larger = {name: replace(hypothesis, effects=(*hypothesis.effects, name)) for name in names}
        return {name: self.log_prior(one) - own for name, one in larger.items()}

    def may_decide(
        self, log_odds: np.ndarray, is_form: np.ndarray, num_effects: np.ndarray
    ) -> np.ndarray:
        """On which hypotheses, `[hypothesis]`, the verdict may hang: these are searched with care.

        Each may still gain `MAY_STILL_GAIN` nats by that. Where the model without effects will do
        and no named effect can come to convince, on none. One with more effects than the leading
        one has paid for them: it is not behind by bad luck.
        """
        named = log_odds[~is_form].max(initial=-np.inf)
        if self.is_adequate and named + MAY_STILL_GAIN < CONVINCING:
            return np.zeros(len(log_odds), bool)
        decisive, leader = decisive_margin(self.is_adequate), int(np.argmax(log_odds))
        is_larger = num_effects > num_effects[leader]
        behind = np.where(is_larger, decisive, farthest(decisive))
        return log_odds > log_odds[leader] - behind - MAY_STILL_GAIN


def decisive_margin(is_base_adequate: bool) -> float:
    """The difference in log odds, nats, at which one hypothesis rules out another."""
    return DECISIVE * (FAINT_FACTOR if is_base_adequate else 1.0)


def log_prior(odds: Sequence[float], num_effects: int) -> float:
    """Log of a hypothesis' probability before the data over that of the model without effects.

    All single effects together are as probable as none, and all pairs `SECOND_EFFECT_ODDS` times
    as probable; all of a kind share alike. `odds`: of each of its effects, how many times as likely
    as others it is (`Effect.odds`). `num_effects`: in the library, forms not counted.
    """
    share = SECOND_EFFECT_ODDS ** (len(odds) - 1) / comb(num_effects, len(odds))
    return log(share) + float(np.sum(np.log(odds)))


def num_expected(odds: Sequence[float]) -> int:
    """How many effects of a hypothesis the clip leads to expect; `odds` as of `log_prior`."""
    return sum(each > EXPECTED_ODDS for each in odds)


def without_surplus(candidates: Sequence[Candidate]) -> list[Candidate]:
    """The candidates without those of more effects than the leading one that cannot contest it.

    Beside every effect that explains the data stand its pairs with whatever does nothing here.
    """
    if not candidates:
        return []
    best = max(candidates, key=lambda c: c.log_odds)
    return [
        c
        for c in candidates
        if len(c.effects) <= max(len(best.effects), 1)
        or best.log_odds - c.log_odds < DECISIVE + ROUGH_NATS
    ]


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


def _effects(trials: JointProblem, hypothesis: Hypothesis) -> list[Effect]:
    effects = trials.problems[0].model.effects
    return [effect for effect in effects if effect.name in hypothesis.effects]
