"""Which laws act in a rollout: the others are not computed.

Most hypotheses have one effect of twenty; the others are pinned where they do nothing. Rollouts in
which no force and no friction law acts have a program without any, in which the motion between
events is known in closed form. All others share one, which is told which laws act in its batch. In
the same way rims that are not round, which take seven times as long, have programs apart.
Where a law is none of the package's its programs cannot be kept (`trace_cache`), and are made anew
in every process: then there is one for all.
"""

import functools
from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool

from galileo_jax.model.effects.effect import Effect
from galileo_jax.model.model import Model

STEADY, WITH_LAWS, WITH_OVALS = 0, 1, 2  # kinds of rollouts: bits of one number
LAW_HOOKS, OVAL_HOOKS = ("force", "push", "friction"), ("oval",)
PACKAGE = f"{__name__.split('.')[0]}."


@dataclass(frozen=True, eq=False)
class Law:
    """An effect with a force or a friction law of its own, or rims that are not round."""

    effect: Effect
    kind: int  # what its rollouts have
    columns: np.ndarray  # of its parameters in the model
    absent: np.ndarray  # their values where it does nothing

    def acts(self, theta: np.ndarray) -> np.ndarray:
        """Whether it acts in each of `theta` `[batch, parameter]`: `[batch]`."""
        return (theta[:, self.columns] != self.absent).any(axis=1)


@dataclass(frozen=True)
class Share:
    """Part of a model."""

    effects: tuple[Effect, ...]  # that may act, nuisances among them
    names: tuple[str, ...]  # of their parameters
    columns: tuple[int, ...]  # where these stand among the model's
    laws: tuple[Law, ...] = ()  # those of `effects` that do not act in every rollout
    places: tuple[int, ...] = ()  # where these stand among `effects`

    def of(self, theta: np.ndarray) -> np.ndarray:
        """Of `theta` `[batch, parameter]` the columns of `names`."""
        return theta[:, self.columns]

    def acts(self, theta: np.ndarray) -> np.ndarray | None:
        """Which of `effects` act in any of `theta`, `[effect]`; None: all, in every rollout."""
        if not self.laws:
            return None
        found = np.ones(len(self.effects), bool)
        found[list(self.places)] = [law.acts(theta).any() for law in self.laws]
        return found


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
        kinds = np.full(acts.shape[1], STEADY if self._is_ours else WITH_LAWS | WITH_OVALS)
        for law, is_there in zip(self._laws, acts, strict=True):
            kinds |= np.where(is_there, law.kind, STEADY)
        return kinds

    def _share_of(self, kind: int) -> Share:
        laws = tuple(law for law in self._laws if law.kind & ~kind == 0)
        return self._without([law.effect for law in self._laws if law not in laws], laws)

    def _without(self, left_out: list[Effect], laws: tuple[Law, ...] = ()) -> Share:
        model, scene = self._model, self._model.scene.surroundings
        gone = {parameter.name for effect in left_out for parameter in effect.parameters(scene)}
        columns = tuple(i for i, name in enumerate(model.names) if name not in gone)
        effects = tuple(e for e in model.effects if e not in left_out) + model.nuisances
        places = tuple(effects.index(law.effect) for law in laws)
        return Share(effects, tuple(model.names[i] for i in columns), columns, laws, places)


def _law(effect: Effect, model: Model) -> Law | None:
    """None of an effect without a place, or without anything that all rollouts do not have."""
    own = type(effect)
    bits = ((WITH_LAWS, LAW_HOOKS), (WITH_OVALS, OVAL_HOOKS))
    kind = sum(
        bit
        for bit, hooks in bits
        if any(getattr(own, hook) is not getattr(Effect, hook) for hook in hooks)
    )
    columns = [model.index(p.name) for p in effect.parameters(model.scene.surroundings)]
    if not kind or not columns:
        return None
    absent = np.array([model.parameters[i].absent for i in columns])
    return Law(effect, kind, np.array(columns), absent)
