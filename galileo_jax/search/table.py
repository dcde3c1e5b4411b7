"""The table of all hypotheses that a search has fitted so far, and a start of another one."""

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Bool, Float, Int

from galileo_jax.inference.fits.gradient import GradientFit, GradientFitter
from galileo_jax.inference.joint_problem import JointProblem
from galileo_jax.model.effects.forms import FORM_NAMES
from galileo_jax.search.hypothesis import Hypothesis, reduced

BASE: frozenset[str] = frozenset()
Key = frozenset[str]
CHANGED_NATS = 1.0  # by which the evidence of what may decide has changed
LEAST_AGREEING = 2  # starts that must end in the best valley, lest it be a chance find
SAME_NATS = 3.0  # by which the evidence of a parent differs that is worth asking again


class Stakes:
    """What hangs on a hypothesis; here, where a model is fitted that has no rivals, nothing."""

    def log_prior(self, hypothesis: Hypothesis) -> float:
        """Log of its probability before the data over that of the model without effects."""
        return 0.0

    def may_decide(
        self,
        log_odds: Float[np.ndarray, " row"],
        is_form: Bool[np.ndarray, " row"],
        num_effects: Int[np.ndarray, " row"],
    ) -> Bool[np.ndarray, " row"]:
        """On which hypotheses the conclusion may hang; these are searched for with care."""
        return np.zeros(len(log_odds), bool)


@dataclass(frozen=True, eq=False)
class Start:
    """A place in the space of all parameters from which a hypothesis is searched for."""

    effects: tuple[str, ...]  # of the hypothesis
    # of the models, without noise scales; each with a unit normal prior
    z: Float[np.ndarray, " parameter"]
    # what it was made from, None where nothing was known; with its last effect added, a score test
    # says what that effect explains
    parent: Hypothesis | None
    move: str  # name of the move that proposes it
    # of a move's starts of a hypothesis with the same label only the best is followed
    rivals: int = 0
    # whether it is refined at once: beside a fit a race, which assumes more noise, would not tell
    # the valleys apart
    is_near: bool = False
    cost: float = np.nan  # where a race ended, nats; there `z` is
    promise: float = np.nan  # that less what the width of the valley is worth
    num_agreeing: int = 0  # starts of the race that ended in its valley; 0: there was none

    @property
    def key(self) -> Key:
        """The effects in no order."""
        return frozenset(self.effects)


@dataclass(frozen=True, eq=False)
class Entry:
    """A row of the table."""

    hypothesis: Hypothesis  # with the best fit
    fits: tuple[GradientFit, ...]  # in every valley that was found
    # what its last effect's slope explained beside its parent, in standard deviations
    score_z: float = 0.0
    num_agreeing: int = LEAST_AGREEING  # starts of the race that found it which ended in its valley

    def with_fits(self, fits: Sequence[GradientFit], by: float = 0.0) -> "Entry":
        """The same with more fits; one that is better `by` nats takes the place of the old one."""
        every, known = (*self.fits, *fits), self.hypothesis
        best = max(every, key=lambda fit: fit.log_evidence)
        if best.log_evidence - known.fit.log_evidence <= by:
            return replace(self, fits=every)
        return replace(self, fits=every, hypothesis=replace(known, fit=best))


@dataclass(frozen=True, eq=False)
class Table:
    """All hypotheses fitted so far."""

    fitter: GradientFitter  # of trials whose models have the whole library
    stakes: Stakes  # what hangs on each
    seed: int  # of the starts
    # by the effects, in no order; that without effects is there after the first round
    entries: Mapping[Key, Entry]
    # whether noise, or what is as usual as noise, explains what a fit leaves
    is_explained: Callable[[Hypothesis], bool]
    # of the models, without noise scales: those that every hypothesis has
    mask: Bool[np.ndarray, " parameter"]
    # what moves proposed already: name of the move, of what, from which evidence
    asked: frozenset[tuple[str, Key, Key, float]] = frozenset()
    num_rounds: int = 0  # of the loop, so far
    most_effects: int = 1  # at once, of the hypotheses that are looked for

    @classmethod
    def of(cls, fitter: GradientFitter, stakes: Stakes, seed: int, base: Hypothesis) -> "Table":
        """The table that holds the model without effects alone."""
        entries = {BASE: Entry(base, (base.fit, *base.fit.beside))}
        mask = fitter.trials.free(())[: len(fitter.trials.model_parameters)]
        return cls(fitter, stakes, seed, entries, lambda one: fitter.is_explained(one.fit), mask)

    @property
    def trials(self) -> JointProblem:
        """What the hypotheses were fitted to."""
        return self.fitter.trials

    @property
    def base(self) -> Hypothesis:
        """The model without effects."""
        return self.entries[BASE].hypothesis

    @property
    def library(self) -> list[str]:
        """The effects that have a name."""
        return [name for name in self.trials.all_effects if name not in FORM_NAMES]

    @property
    def best_first(self) -> list[Entry]:
        """The rows with effects, the most probable first."""
        rows = [entry for key, entry in self.entries.items() if key != BASE]
        return sorted(rows, key=lambda entry: -self.log_odds(entry.hypothesis))

    def named(self, num_effects: int) -> list[Hypothesis]:
        """The hypotheses of so many effects, all with a name, the best evidence first."""
        found = [
            entry.hypothesis
            for key, entry in self.entries.items()
            if len(key) == num_effects and not is_form(key)
        ]
        return sorted(found, key=lambda one: -one.fit.log_evidence)

    def leaders(self, num: int) -> list[Hypothesis]:
        """The most probable hypotheses with effects."""
        return [entry.hypothesis for entry in self.best_first[:num]]

    def log_odds(self, hypothesis: Hypothesis) -> float:
        """Over the model without effects, nats."""
        return hypothesis.evidence_over(self.base) + self.stakes.log_prior(hypothesis)

    def free(self, sets: Sequence[Collection[str]]) -> Bool[np.ndarray, "row parameter"]:
        """Which of the model's parameters sets of effects leave open."""
        count = len(self.trials.model_parameters)
        return np.stack([self.mask | self.trials.free(tuple(own))[:count] for own in sets])

    def deciding(self) -> list[Key]:
        """The hypotheses on which the conclusion may hang, the best evidence first."""
        rows = self.best_first
        if not rows:
            return []
        log_odds = np.array([self.log_odds(row.hypothesis) for row in rows])
        forms = np.array([is_form(row.hypothesis.key) for row in rows])
        every = (self.base, *(row.hypothesis for row in rows))
        if any(map(self.is_explained, every)):
            numbers = np.array([len(row.hypothesis.effects) for row in rows])
            decides = self.stakes.may_decide(log_odds, forms, numbers)
        else:  # any fit may yet be the one that does
            decides = np.ones(len(rows), bool)
        found = [row for row, does in zip(rows, decides, strict=True) if does]
        by_evidence = sorted(found, key=lambda row: -row.hypothesis.fit.log_evidence)
        return [row.hypothesis.key for row in by_evidence]

    @property
    def is_in_doubt(self) -> bool:
        """Whether a fit alone, with no rival, may be in a side valley."""
        if self.most_effects or BASE not in self.entries:
            return False
        is_chance = self.entries[BASE].num_agreeing < LEAST_AGREEING and self.num_rounds == 1
        return is_chance or not self.is_explained(self.base)

    def has_asked(self, move: str) -> bool:
        """Whether a move has proposed anything."""
        return any(name == move for name, *_ in self.asked)

    def not_asked(
        self, move: str, wanted: Sequence[tuple[Hypothesis, tuple[str, ...]]]
    ) -> list[tuple[Hypothesis, tuple[str, ...]]]:
        """Of proposals `(parent, effects)` those that this move has not made from such a parent."""
        return [
            (parent, effects)
            for parent, effects in wanted
            if ask(move, parent, frozenset(effects)) not in self.asked
        ]

    def replacements(
        self, num_leaders: int
    ) -> list[tuple[Hypothesis, str, Hypothesis, tuple[str, ...]]]:
        """Leaders, one of their effects, what they are without it, and with which others instead.

        Forms without a name take only the place of a single effect.
        """
        found = []
        for leader in self.leaders(num_leaders):
            for one in leader.effects:
                kept = tuple(name for name in leader.effects if name != one)
                parent = reduced(self.trials, leader, kept)
                for name in self.library if kept else self.trials.all_effects:
                    if name not in leader.effects:
                        found.append((leader, one, parent, (*kept, name)))
        return found

    def is_better_than(self, other: "Table") -> bool:
        """Whether it has a fit that another table has not."""
        known = {id(entry.hypothesis.fit) for entry in other.entries.values()}
        return any(id(entry.hypothesis.fit) not in known for entry in self.entries.values())

    def with_entry(self, entry: Entry) -> "Table":
        """The table with a row more, or another in its place."""
        return replace(self, entries={**self.entries, entry.hypothesis.key: entry})


def ask(move: str, parent: Hypothesis | None, key: Key) -> tuple[str, Key, Key, float]:
    """What makes two proposals of a move one: what for, and from which fit."""
    if parent is None:
        return move, BASE, key, -np.inf
    return move, parent.key, key, parent.fit.log_evidence // SAME_NATS


def is_form(key: Collection[str]) -> bool:
    """Whether a hypothesis is of a form without a name."""
    return any(name in FORM_NAMES for name in key)
