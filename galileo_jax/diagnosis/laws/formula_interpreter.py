"""Formulas as numbers: the same compiled rollouts for all that are ever proposed.

A program with the formulas written into it would have to be compiled for every clip anew, since no
two suggest the same: 14 CPU seconds. A hypothesis has one formula only; so a rollout gets the
formula that acts in it as codes (its nature, whom it acts on, which factors) beside its constants.
All factors are computed and one is taken, which costs no more than the eight formulas did.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from galileo_jax.diagnosis.laws.grammar import FACTORS, SEVERAL, Factor, Structure
from galileo_jax.model.effects.effect import (
    Array,
    Effect,
    Force,
    Friction,
    State,
    Surroundings,
    Theta,
)
from galileo_jax.model.effects.law import against_motion, changed_friction
from galileo_jax.model.model import Model
from galileo_jax.model.parameters import Parameter
from galileo_jax.rollout.acting_laws import STEADY, WITH_LAWS, ActingLaws, Share

STRENGTH, IS_ON_ALL, NATURE = "law", "law_is_on_all", "law_nature"
FIRST, SECOND = ("law_1", "law_1_a", "law_1_b"), ("law_2", "law_2_a", "law_2_b")
NAMES = (STRENGTH, IS_ON_ALL, NATURE, *FIRST, *SECOND)
NATURES = ("push", "drag", "drag_force", "friction")
TOGETHER = 2  # kind of rollouts in which several formulas act


class LawAsForce(Effect):
    """The formula that acts, where it is a push or a drag."""

    name: ClassVar[str] = "law_as_force"

    def parameters(self, scene: Surroundings) -> tuple[Parameter, ...]:
        """None: what a rollout is given stands in no model."""
        return ()

    def force(self, theta: Theta, scene: Surroundings) -> Force:
        """As `Law.force`."""
        masses = scene.mass(theta)
        xp = masses[0].__array_namespace__()
        mass = xp.stack(masses, axis=-1)
        nature = theta[NATURE][..., None]
        mass = xp.where(nature == NATURES.index("drag_force"), masses[0][..., None], mass)

        def act(state: State) -> Array:
            size = mass * _value(theta, scene, state)
            against = against_motion(size, state.speed_m_s)
            force = xp.where(nature == NATURES.index("push"), size, against)
            return xp.where(nature == NATURES.index("friction"), 0.0, force)

        return act


class LawAsFriction(Effect):
    """The formula that acts, where it changes friction."""

    name: ClassVar[str] = "law_as_friction"

    def parameters(self, scene: Surroundings) -> tuple[Parameter, ...]:
        """None: what a rollout is given stands in no model."""
        return ()

    def friction(self, theta: Theta, scene: Surroundings) -> Friction | None:
        """As `Law.friction`; None where nothing slides on a surface."""
        if not scene.has_surface:
            return None

        def law(state: State, k: Array) -> Array:
            begin = _value(theta, scene, _at_release(scene, state))
            changed = changed_friction(k, _value(theta, scene, state) - begin)
            is_own = theta[NATURE][..., None] == NATURES.index("friction")
            return k.__array_namespace__().where(is_own, changed, k)

        return law


def _at_release(scene: Surroundings, state: State) -> State:
    """Where the motion begins: at time 0, at the place of the release, at rest."""
    path = state.path_m
    begin = 0.0 * path + path.__array_namespace__().asarray(scene.start_path_m)
    return state._replace(time_s=0.0 * state.time_s, path_m=begin, speed_m_s=0.0 * state.speed_m_s)


def _value(theta: Theta, scene: Surroundings, state: State) -> Array:
    """C f on the objects it acts on, 0 on others."""
    path, speed = state.path_m, state.speed_m_s
    xp = path.__array_namespace__()
    is_first = xp.asarray([float(i == 0) for i in range(len(scene.names))])
    chosen = xp.maximum(theta[IS_ON_ALL][..., None], is_first)
    place = (state.time_s + 0.0 * path, path, speed)
    f = _factor(FACTORS, [theta[name][..., None] for name in FIRST], place, xp)
    f = f * _factor(SEVERAL, [theta[name][..., None] for name in SECOND], place, xp)
    return theta[STRENGTH][..., None] * chosen * f


def _factor(factors: Sequence[Factor], own: Sequence[Array], place: tuple, xp: Any) -> Array:
    """One of `factors` by its code, counted from 1, and its constants; code 0: 1."""
    code, *constants = own
    t, q, v = place
    value = 1.0 + 0.0 * q
    for i, factor in enumerate(factors):
        one = factor.value(t, q, v, xp, constants)
        value = xp.where(code == i + 1, one, value)
    return value


@dataclass(frozen=True, eq=False)
class OneLaw(Share):
    """Part of a model: without its formulas, but with the one that acts in each rollout."""

    # of each, where its strength and constants stand, and its numbers
    formulas: tuple[tuple[np.ndarray, np.ndarray, np.ndarray], ...] = ()

    def of(self, theta: np.ndarray) -> np.ndarray:
        """Of `theta` `[batch, parameter]` the columns of `names`."""
        numbers = np.ones((len(theta), len(NAMES)))
        numbers[:, 0] = 0.0
        for columns, codes, slots in self.formulas:
            acts = np.flatnonzero(theta[:, columns[0]])
            numbers[acts] = codes
            numbers[np.ix_(acts, slots)] = theta[np.ix_(acts, columns)]
        return np.concatenate([super().of(theta), numbers], axis=1)

    def acts(self, theta: np.ndarray) -> np.ndarray:
        """Whether a force, and whether a friction law acts in any; nuisances do."""
        nature = self.of(theta)[:, -len(NAMES) + NAMES.index(NATURE)]
        is_friction = nature == NATURES.index("friction")
        return np.array(
            [not is_friction.all(), is_friction.any(), *[True] * (len(self.effects) - 2)]
        )


class ActingFormulas(ActingLaws):
    """Of a model whose effects are proposed formulas, `structures` by their names."""

    def __init__(self, model: Model, structures: Mapping[str, Structure]):
        super().__init__(model)
        self._formulas = tuple(
            (law.columns, *codes_of(structures[law.effect.name]))
            for law in self._laws
            if law.effect.name in structures
        )

    def _kinds(self, acts: np.ndarray) -> np.ndarray:
        return np.minimum(acts.sum(axis=0), TOGETHER)

    def _share_of(self, kind: int) -> Share:
        if kind == TOGETHER:
            return super()._share_of(WITH_LAWS)
        without = super()._share_of(STEADY)
        if kind == STEADY:
            return without
        return OneLaw(
            (LawAsForce(), LawAsFriction(), *without.effects),
            (*without.names, *NAMES),
            without.columns,
            without.absent,
            formulas=self._formulas,
        )


def codes_of(structure: Structure) -> tuple[np.ndarray, np.ndarray]:
    """What a formula has in `NAMES`, and where its strength and constants stand there."""
    codes, slots = dict.fromkeys(NAMES, 1.0), [STRENGTH]
    codes[IS_ON_ALL] = float(structure.is_on_all)
    codes[NATURE] = float(NATURES.index(structure.nature))
    codes[SECOND[0]] = 0.0
    for names, factors, factor in zip(
        (FIRST, SECOND), (FACTORS, SEVERAL), structure.factors, strict=False
    ):
        codes[names[0]] = float(factors.index(factor)) + 1.0
        slots += names[1 : 1 + len(factor.constants)]
    return np.array(list(codes.values())), np.array([NAMES.index(name) for name in slots])
