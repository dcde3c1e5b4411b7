"""Hypotheses in an imperfect world: beside each the imperfections that it asks for.

Where the exact model without effects is contradicted and no single effect mends that, it and the
best effects are fitted with imperfections whose sizes are inferred (`statespace`). What an effect
explains, imperfections no longer have to; so evidence with all sizes integrated tells them apart.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from galileo_jax.comparison.compare import Comparison, compare
from galileo_jax.diagnosis.diagnosis import Candidate, Round
from galileo_jax.diagnosis.friction_along_way import FrictionAlongWay, Stretch, friction_along_way
from galileo_jax.diagnosis.stakes import odds_of
from galileo_jax.diagnosis.verdict import (
    CONVINCING,
    explains,
    num_expected,
    ranked,
    rivals,
    to_compare,
)
from galileo_jax.inference.fits.gradient import Code
from galileo_jax.inference.joint_problem import JointProblem
from galileo_jax.inference.result import error_of
from galileo_jax.search.hypothesis import Hypothesis
from galileo_jax.search.imperfect import with_imperfections
from galileo_jax.statespace.terms.friction_roughness import NAME

# Beside none: so many of the most probable of each kind in the exact world.
NUM_SINGLE, NUM_FORMS, NUM_PAIRS, NUM_LAWS = 6, 2, 2, 2


@dataclass(frozen=True)
class ImperfectWorld:
    """The model without effects and candidates, each with imperfections.

    Attributes:
      base: without effects.
      comparison: of it with the data.
      table: ranked; evidence is over that of `base`.
      decisive: nats by which one must be ahead of another.
      friction: of each clip, where friction varies by more than is usual; else empty.
    """

    base: Hypothesis
    comparison: Comparison
    table: tuple[Candidate, ...]
    decisive: float
    friction: tuple[FrictionAlongWay, ...] = ()

    @property
    def pushing(self) -> Stretch | None:
        """Where friction would have to push beyond doubt, the clearest; None: nowhere."""
        every = [one for clip in self.friction for one in clip.stretches if one.pushes]
        return min(every, key=lambda one: one.mean / one.sd, default=None)

    def round_called(self, effects: tuple[str, ...]) -> Round:
        """The base as a round, its imperfections part of the model by the name of effects."""
        fit, trials = self.base.fit, self.base.trials
        assert trials is not None
        theta = trials.theta(fit.z, fit.free)
        error = error_of(trials, theta, fit.num_fitted, fit.pull, is_usual=False)
        return Round(self.base, replace(self.comparison, error=error), called=effects)

    def with_candidates(
        self, trials: JointProblem, candidates: Sequence[Candidate], seed: int
    ) -> "ImperfectWorld":
        """The same with the best of more candidates in its table.

        Args:
          trials: what was diagnosed.
          candidates: ranked, of the exact world.
          seed: of the replicates.
        """
        known = {c.effects: c for c in self.table}
        for candidate in _best(candidates):
            if candidate.effects not in known:
                sized = _sized(trials, self.base, candidate)
                known |= {} if sized is None else {sized.effects: sized}
        for c in to_compare(ranked(known.values()), self.decisive):
            if c.p_value is None:
                found = compare(c.hypothesis.of(trials), c.hypothesis.fit, seed)
                known[c.effects] = replace(c, p_value=found.p_value)
        done = ranked(known.values())
        return replace(self, table=tuple(replace(c, confounded_with=rivals(c, done)) for c in done))

    def is_beaten_by(self, candidates: Sequence[Candidate]) -> bool:
        """Whether an effect in an exact world is far more probable than none in this one.

        Args:
          candidates: of the exact world, compared with the data.
        """
        base = self.base.fit.log_evidence
        return any(
            explains(c) and c.hypothesis.fit.log_evidence + c.log_prior - base >= CONVINCING
            for c in candidates
        )

    def with_the_rest(self, candidates: Sequence[Candidate]) -> tuple[Candidate, ...]:
        """The table and, of candidates that are not in it, the exact fits over the same base."""
        known = {c.effects for c in self.table}
        base = self.base.fit.log_evidence
        rest = [
            replace(c, log_evidence=c.hypothesis.fit.log_evidence - base, p_value=None)
            for c in candidates
            if c.effects not in known
        ]
        return ranked((*self.table, *rest))


def imperfect_world(
    trials: JointProblem, base: Hypothesis, decisive: float, seed: int
) -> ImperfectWorld | None:
    """The model without effects in an imperfect world; None where nothing is imperfect there.

    Args:
      trials: what was diagnosed.
      base: the exact model without effects.
      decisive: nats by which one hypothesis must be ahead of another.
      seed: of the replicates.
    """
    world = with_imperfections(trials, base.fit, to_rest=False)
    if world.fit.sizes is None or world.fit.code is Code.FAILED:
        return None
    sized = Hypothesis(base.effects, world.fit, world.trials)
    friction: tuple[FrictionAlongWay, ...] = ()
    if NAME in world.fit.sizes.unusual:
        every = range(len(trials.problems))
        friction = tuple(friction_along_way(world.trials, world.fit, clip) for clip in every)
    comparison = compare(world.trials, world.fit, seed)
    return ImperfectWorld(sized, comparison, (), decisive, friction)


def _best(candidates: Sequence[Candidate]) -> list[Candidate]:
    """Of each kind a few."""
    laws = [c for c in candidates if c.law is not None]
    forms = [c for c in candidates if c.law is None and c.is_form]
    named = [c for c in candidates if c.law is None and not c.is_form]
    pairs = [c for c in named if len(c.effects) > 1]
    single = [c for c in named if len(c.effects) == 1]
    return [
        *laws[:NUM_LAWS],
        *forms[:NUM_FORMS],
        *pairs[:NUM_PAIRS],
        *single[:NUM_SINGLE],
    ]


def _sized(trials: JointProblem, base: Hypothesis, candidate: Candidate) -> Candidate | None:
    """A candidate with imperfections; None where its fit fails with them."""
    own = candidate.hypothesis.of(trials)
    world = with_imperfections(own, candidate.hypothesis.fit, to_rest=False)
    fit = world.fit
    if fit.sizes is None or fit.code is Code.FAILED:
        return None
    theta = world.trials.theta(fit.z, fit.free)
    hypothesis = Hypothesis(candidate.effects, fit, world.trials)
    # What the clip leads to expect depends on the strength, which is another beside imperfections.
    before, now = odds_of(own, candidate.hypothesis), odds_of(world.trials, hypothesis)
    return replace(
        candidate,
        hypothesis=hypothesis,
        log_prior=candidate.log_prior + float(np.sum(np.log(now)) - np.sum(np.log(before))),
        num_expected=num_expected(now),
        error=error_of(world.trials, theta, fit.num_fitted, fit.pull),
        log_evidence=fit.log_evidence - base.fit.log_evidence,
        p_value=None,
        confounded_with=(),
        unusual=tuple(fit.sizes.unusual),
    )
