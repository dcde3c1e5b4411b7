"""Hypotheses in an imperfect world: beside each the imperfections that it asks for.

Where the exact model without effects is contradicted and no single effect mends that, it and the
best effects are fitted with imperfections whose sizes are inferred (`statespace`). What an effect
explains, imperfections no longer have to; so evidence with all sizes integrated tells them apart.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from galileo_jax.comparison.compare import Comparison, compare
from galileo_jax.diagnosis.candidates import error_left, incredible
from galileo_jax.diagnosis.diagnosis import Candidate, Round, Verdict
from galileo_jax.diagnosis.friction_along_way import Stretch, friction_along_way
from galileo_jax.diagnosis.judge import Judge
from galileo_jax.diagnosis.law_verdict import law_verdict
from galileo_jax.diagnosis.stakes import num_expected, odds_of
from galileo_jax.diagnosis.thresholds import CONVINCING, DECISIVE
from galileo_jax.diagnosis.verdict import explains, ranked, without_a_name
from galileo_jax.inference.fits.gradient import Code
from galileo_jax.inference.joint_problem import JointProblem
from galileo_jax.inference.result import error_of
from galileo_jax.search.hypothesis import Hypothesis
from galileo_jax.search.imperfect import with_imperfections
from galileo_jax.search.table import Table
from galileo_jax.statespace.terms import ROUGHNESS

# Beside none: so many of the most probable of each kind in the exact world, and pairs that contest
# the best of them.
NUM_SINGLE, NUM_FORMS, NUM_PAIRS, NUM_LAWS = 6, 2, 2, 2


@dataclass(frozen=True)
class ImperfectWorld:
    """The model without effects and candidates, each with imperfections."""

    base: Hypothesis  # without effects
    comparison: Comparison  # of it with the data
    table: tuple[Candidate, ...]  # ranked; evidence is over that of `base`
    judge: Judge  # of this world
    # of each clip, where friction varies by more than is usual; else empty
    friction: tuple[tuple[Stretch, ...], ...] = ()

    @property
    def pushing(self) -> Stretch | None:
        """Where friction would have to push beyond doubt, the clearest; None: nowhere."""
        every = [one for clip in self.friction for one in clip if one.pushes]
        return min(every, key=lambda one: one.mean / one.sd, default=None)

    def round_called(self, effects: tuple[str, ...]) -> Round:
        """The base as a round, its imperfections part of the model by the name of effects."""
        fit, trials = self.base.fit, self.base.trials
        assert trials is not None
        theta = trials.theta(fit.z, fit.free)
        error = error_of(trials, theta, fit.num_fitted, fit.pull, is_usual=False)
        return Round(self.base, replace(self.comparison, error=error), called=effects)

    def with_candidates(self, candidates: Sequence[Candidate]) -> "ImperfectWorld":
        """The same with the best of more candidates, ranked, of the exact world in its table."""
        known = {c.effects: c for c in self.table}
        new = [c for c in _best(candidates) if c.effects not in known]
        sized = [_sized(self.judge.trials, self.base, candidate) for candidate in new]
        every = (*self.table, *(c for c in sized if c is not None))
        return replace(self, table=self.judge.compared(every) if every else ())

    def verdict(self) -> Verdict:
        """The verdict on its table."""
        scenes = [one.model.scene.surroundings for one in self.judge.trials.problems]
        is_friction = self.pushing is None and not any(all(one.rolls or (False,)) for one in scenes)
        sure = without_a_name(self.comparison, self.table, is_friction)
        sure = sure or law_verdict(self.table, self.judge.decisive)
        if sure is not None:
            return sure
        found = self.judge.verdict(self.table)
        is_law = {c.name for c in self.table if c.law is not None}
        is_named = not is_law & set(found.names)
        return found if is_named else Verdict("unknown", (), reasons=found.reasons)

    def is_beaten_by(self, candidates: Sequence[Candidate]) -> bool:
        """Whether an effect in an exact world is far more probable than none in this one."""
        return any(
            explains(c) and self._log_evidence(c.hypothesis) + c.log_prior >= CONVINCING
            for c in candidates
        )

    def is_contested_by(self, table: Table) -> bool:
        """Whether two effects in an exact world are about as probable as the best of this one.

        Imperfections of usual sizes beside one effect may stand for a second.
        """
        least = self.table[0].log_odds - DECISIVE
        return any(
            self._log_evidence(pair) + table.stakes.log_prior(pair) > least
            for pair in table.named(2)
        )

    def _log_evidence(self, exact: Hypothesis) -> float:
        """Of a hypothesis in an exact world over none in this one, nats."""
        return exact.fit.log_evidence - self.base.fit.log_evidence

    def with_the_rest(self, candidates: Sequence[Candidate]) -> tuple[Candidate, ...]:
        """The table and, of candidates that are not in it, the exact fits over the same base."""
        known = {c.effects for c in self.table}
        rest = [
            replace(c, log_evidence=self._log_evidence(c.hypothesis), p_value=None)
            for c in candidates
            if c.effects not in known
        ]
        return ranked((*self.table, *rest))


def imperfect_world(judge: Judge, base: Hypothesis) -> ImperfectWorld | None:
    """The model without effects in an imperfect world; None where nothing is imperfect there."""
    trials = judge.trials
    world = with_imperfections(trials, base.fit, to_rest=False)
    if world.fit.sizes is None or world.fit.code is Code.FAILED:
        return None
    sized = Hypothesis(base.effects, world.fit, world.trials)
    friction: tuple[tuple[Stretch, ...], ...] = ()
    if ROUGHNESS in world.fit.sizes.unusual:
        every = range(len(trials.problems))
        friction = tuple(friction_along_way(world.trials, world.fit, clip) for clip in every)
    comparison = compare(world.trials, world.fit, judge.seed)
    return ImperfectWorld(sized, comparison, (), replace(judge, comparisons={}), friction)


def _best(candidates: Sequence[Candidate]) -> list[Candidate]:
    """Of each kind a few."""
    laws = [c for c in candidates if c.law is not None]
    forms = [c for c in candidates if c.law is None and c.is_form]
    named = [c for c in candidates if c.law is None and not c.is_form]
    pairs = [c for c in named if len(c.effects) > 1]
    single = [c for c in named if len(c.effects) == 1]
    near = [
        c for i, c in enumerate(pairs) if i < NUM_PAIRS or pairs[0].log_odds - c.log_odds < DECISIVE
    ]
    return [*laws[:NUM_LAWS], *forms[:NUM_FORMS], *near, *single[:NUM_SINGLE]]


def _sized(trials: JointProblem, base: Hypothesis, candidate: Candidate) -> Candidate | None:
    """A candidate with imperfections; None where its fit fails with them."""
    own = candidate.hypothesis.of(trials)
    world = with_imperfections(own, candidate.hypothesis.fit, to_rest=False)
    fit = world.fit
    if fit.sizes is None or fit.code is Code.FAILED:
        return None
    hypothesis = Hypothesis(candidate.effects, fit, world.trials)
    # What the clip leads to expect depends on the strength, which is another beside imperfections.
    before, now = odds_of(own, candidate.hypothesis), odds_of(world.trials, hypothesis)
    return replace(
        candidate,
        hypothesis=hypothesis,
        log_prior=candidate.log_prior + float(np.sum(np.log(now)) - np.sum(np.log(before))),
        num_expected=num_expected(now),
        error=error_left(world.trials, fit),
        log_evidence=fit.log_evidence - base.fit.log_evidence,
        p_value=None,
        confounded_with=(),
        unusual=(*fit.sizes.unusual, *incredible(world.trials, hypothesis)),
    )
