"""Parts of a model that programs are compiled for.

Most hypotheses have one effect of twenty; the others are pinned where they do nothing. Rollouts in
which no force and no friction law acts have a program without any, in which the motion between
events is known in closed form. All others share one, which is told which laws act in its batch. In
the same way rims that are not round, which take seven times as long, have programs apart, and so
has dry friction of what swings, which is held where it turns back: without it nothing
interrupts the swing.

A part of library effects holds all of them that have a place in the scene: those that the model
does not have do nothing, and a fit and a diagnosis, of whatever effects, call the same programs.
Where an effect is none of the package's its programs cannot be kept (`trace_cache`), and are made
anew in every process: then there is one for all.
"""

import functools
from dataclasses import dataclass
from typing import Any

import numpy as np
from jaxtyping import Bool

from galileo_jax.model.effects.effect import HOOKS, Effect
from galileo_jax.model.effects.registry import library_effects
from galileo_jax.model.model import Model

STEADY, WITH_LAWS, WITH_OVALS, WITH_TURNS = 0, 1, 2, 4  # kinds of rollouts: bits of one number
EVERY_KIND = WITH_LAWS | WITH_OVALS | WITH_TURNS
LAW_HOOKS, OVAL_HOOKS = {"force", "push", "friction"}, {"oval"}
SEEN_HOOKS = {"time", "measure"}  # that change what is seen of a motion
TOLD_HOOKS = {"parameters", "odds", "derived"}  # that change neither
PACKAGE = f"{__name__.split('.')[0]}."


@dataclass(frozen=True, eq=False)
class Law:
    """An effect with a force or a friction law of its own, or rims that are not round."""

    effect: Effect
    kind: int  # what its rollouts have
    columns: np.ndarray  # of its parameters in the model; none where that does not have it
    absent: np.ndarray  # their values where it does nothing

    def acts(self, theta: np.ndarray) -> np.ndarray:
        """Whether it acts in each of `theta` `[batch, parameter]`: `[batch]`."""
        return (theta[:, self.columns] != self.absent).any(axis=1)


@dataclass(frozen=True, eq=False)
class Share:
    """Part of a model."""

    effects: tuple[Effect, ...]  # that may act, nuisances among them
    names: tuple[str, ...]  # of their parameters, after those of no effect
    # `[name]`, where these stand among the model's parameters and, after them, `absent`
    columns: np.ndarray
    absent: np.ndarray  # values at which effects that the model does not have do nothing
    # Those of `effects` that do not act in every rollout, and where these stand there
    laws: tuple[tuple[int, Law], ...] = ()

    def of(self, theta: Any) -> Any:
        """Of `theta` `[..., parameter]` of the model, NumPy's or JAX's, the part's own."""
        xp = theta.__array_namespace__()
        absent = xp.asarray(self.absent, dtype=theta.dtype)
        absent = xp.broadcast_to(absent, (*theta.shape[:-1], len(self.absent)))
        return xp.concat([theta, absent], axis=-1)[..., self.columns]

    def acts(self, theta: np.ndarray) -> np.ndarray | None:
        """Which of `effects` act in any of `theta`, `[effect]`; None: all, in every rollout."""
        if not self.laws:
            return None
        found = np.ones(len(self.effects), bool)
        for place, law in self.laws:
            found[place] = law.acts(theta).any()
        return found


def seen_share(model: Model) -> Share:
    """What of a model changes what is seen of a motion."""
    return _share(model, [e for e in _every(model) if _has(e, SEEN_HOOKS)])


class ActingLaws:
    """Of a model."""

    def __init__(self, model: Model):
        self._model = model
        self._share = functools.cache(self._share_of)
        self._laws = tuple(law for e in model.effects if (law := _law(e, model)) is not None)
        self._is_ours = all(type(e).__module__.startswith(PACKAGE) for e in model.effects)

    def shares(self, theta: np.ndarray) -> list[tuple[Share, np.ndarray]]:
        """Divides `theta` `[batch, parameter]` among parts of the model.

        Returns:
          parts, and the rows of each: those with the same laws side by side.
        """
        acts = np.zeros((len(self._laws), len(theta)), bool)
        for i, law in enumerate(self._laws):
            acts[i] = law.acts(theta)
        kinds = self._kinds(acts)
        order = np.lexsort((*acts, kinds))
        return [(self._share(int(k)), order[kinds[order] == k]) for k in np.unique(kinds)]

    def _kinds(self, acts: Bool[np.ndarray, "law batch"]) -> np.ndarray:
        """Which program each rollout has, `[batch]`."""
        kinds = np.full(acts.shape[1], STEADY if self._is_ours else EVERY_KIND)
        for law, is_there in zip(self._laws, acts, strict=True):
            kinds |= np.where(is_there, law.kind, STEADY)
        return kinds

    def _share_of(self, kind: int) -> Share:
        moving = HOOKS - SEEN_HOOKS - TOLD_HOOKS
        return _share(
            self._model,
            [
                effect
                for effect in _every(self._model)
                if (_has(effect, moving) or not _has(effect, SEEN_HOOKS))
                and (effect in self._model.nuisances or _kind(effect, self._model) & ~kind == 0)
            ],
        )


def _every(model: Model) -> list[Effect]:
    """The model's effects, its nuisances, and all of the library that have a place in its scene."""
    scene, own, found = model.scene.surroundings, set(model.names), list(model.effects)
    for effect in library_effects():
        names = {parameter.name for parameter in effect.parameters(scene)}
        if names and not names & own:  # a law of the scenario's may have a name of the library's
            found.append(effect)
    return sorted(found, key=lambda e: e.name) + list(model.nuisances)


def _share(model: Model, effects: list[Effect]) -> Share:
    """The part of a model that has these effects; the library's where it has others beside."""
    scene, library = model.scene.surroundings, library_effects()
    if any(e in model.effects and e not in library for e in effects):
        effects = [e for e in effects if e in model.effects + model.nuisances]
    own = {p.name for e in model.effects + model.nuisances for p in e.parameters(scene)}
    named = {p.name: p.absent for e in effects for p in e.parameters(scene)}
    names = dict.fromkeys([*(name for name in model.names if name not in own), *named])
    others = [name for name in names if name not in model.names]
    every = [*model.names, *others]
    laws = [(i, _law(e, model)) for i, e in enumerate(effects) if e not in model.nuisances]
    return Share(
        tuple(effects),
        tuple(names),
        np.array([every.index(name) for name in names]),
        np.array([named[name] for name in others]),
        tuple((i, law) for i, law in laws if law is not None),
    )


def _has(effect: Effect, hooks: set[str]) -> bool:
    """Whether an effect has one of these hooks."""
    return any(getattr(type(effect), hook) is not getattr(Effect, hook) for hook in hooks)


def _kind(effect: Effect, model: Model) -> int:
    """What rollouts have in which it acts."""
    kind = WITH_LAWS * _has(effect, LAW_HOOKS) | WITH_OVALS * _has(effect, OVAL_HOOKS)
    return kind | WITH_TURNS * _rubs(effect, model)


def _rubs(effect: Effect, model: Model) -> bool:
    """Whether it is dry friction of what slides on nothing."""
    scene = model.scene.surroundings
    if scene.has_surface or not _has(effect, {"friction"}):
        return False
    parameters = (*model.parameters, *effect.parameters(scene))
    theta = {parameter.name: np.asarray(parameter.absent) for parameter in parameters}
    return effect.friction(theta, scene) is not None


def _law(effect: Effect, model: Model) -> Law | None:
    """None of an effect without a place, or without anything that all rollouts do not have."""
    parameters = effect.parameters(model.scene.surroundings)
    kind = _kind(effect, model)
    if not kind or not parameters:
        return None
    own = [p for p in parameters if p.name in model.names]
    columns = np.array([model.index(p.name) for p in own], int)
    return Law(effect, kind, columns, np.array([p.absent for p in own]))
