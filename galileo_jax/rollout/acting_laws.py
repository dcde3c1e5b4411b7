"""Which laws act in a rollout: programs without the others are up to twice as fast.

Most hypotheses have one effect of twenty; the others are pinned where they do nothing. Effects
without a force or a friction law of their own cost little and are in every program. Those with a
force, and those with a friction law, are left out where none of them acts: four programs in all.
Where a law is none of the package's its programs cannot be kept (`trace_cache`), and are made anew
in every process: then there is one for all.
"""

import functools
from dataclasses import dataclass

import numpy as np

from galileo_jax.model.effects.effect import Effect
from galileo_jax.model.model import Model

FORCES, FRICTIONS = 1, 2
PACKAGE = f"{__name__.split('.')[0]}."
FEW = 16  # rollouts: fewer are not worth a program of their own


@dataclass(frozen=True)
class Share:
    """Part of a model.

    Attributes:
      effects: that may act, nuisances among them.
      names: of their parameters.
      columns: where these stand among the model's.
    """

    effects: tuple[Effect, ...]
    names: tuple[str, ...]
    columns: tuple[int, ...]

    def of(self, theta: np.ndarray) -> np.ndarray:
        """Of `theta` `[batch, parameter]` the columns of `names`."""
        return theta[:, self.columns]


class ActingLaws:
    """Of a model."""

    def __init__(self, model: Model):
        self._model = model
        self._share = functools.cache(self._share_of)
        self._table: list[tuple[int, np.ndarray, np.ndarray]] = []
        if not all(type(effect).__module__.startswith(PACKAGE) for effect in model.effects):
            return
        for effect in model.effects:
            columns = self._columns(effect)
            if _law(effect) and columns.size:
                absent = np.array([model.parameters[i].absent for i in columns])
                self._table.append((_law(effect), columns, absent))

    def in_each(self, theta: np.ndarray) -> np.ndarray:
        """What acts in each of `theta` `[batch, parameter]`: the sum of `FORCES`, `FRICTIONS`.

        Where few rollouts have the same, they have what acts in any.
        """
        found = self.acting(theta)
        kinds, where, count = np.unique(found, return_inverse=True, return_counts=True)
        few = count < FEW
        if len(kinds) > 1 and few.any():
            found[few[where]] = np.bitwise_or.reduce(found)
        return found

    def acting(self, theta: np.ndarray) -> np.ndarray:
        """As `in_each`, of each rollout by itself."""
        found = np.full(len(theta), 0 if self._table else FORCES | FRICTIONS)
        for law, columns, absent in self._table:
            acts = (theta[:, columns] != absent).any(axis=1)
            found |= np.where(acts, law, 0)
        return found

    def share(self, laws: int) -> Share:
        """The part of the model in which these act: a sum of `FORCES` and `FRICTIONS`."""
        return self._share(laws)

    def _share_of(self, laws: int) -> Share:
        model = self._model
        left_out = [e for e in model.effects if _law(e) & ~laws]
        gone = {int(i) for effect in left_out for i in self._columns(effect)}
        columns = tuple(i for i in range(len(model.names)) if i not in gone)
        effects = tuple(e for e in model.effects if e not in left_out) + model.nuisances
        return Share(effects, tuple(model.names[i] for i in columns), columns)

    def _columns(self, effect: Effect) -> np.ndarray:
        parameters = effect.parameters(self._model.scene.surroundings)
        return np.array([self._model.index(p.name) for p in parameters], int)


def _law(effect: Effect) -> int:
    own = type(effect)
    forces = own.force is not Effect.force or own.push is not Effect.push
    frictions = own.friction is not Effect.friction
    return FORCES * forces + FRICTIONS * frictions
