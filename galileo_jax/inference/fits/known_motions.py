"""Motions at the last few points and their slopes: a fit asks for the same ones again.

It refines where a search ended, and goes on from there with other noise, of which rollouts know
nothing.
"""

from collections import OrderedDict
from collections.abc import Sequence

import numpy as np

MOST_POINTS, FEW_POINTS = 64, 16  # of all; of one batch: larger ones are of a search

Motion = tuple[np.ndarray, ...]
"""Centres and velocities, and their slopes to each free parameter: of a point, or `[point, ...]`"""


class KnownMotions:
    """Of one clip."""

    def __init__(self) -> None:
        self._known: OrderedDict[bytes, Motion] = OrderedDict()

    def of(self, z: np.ndarray, free: np.ndarray) -> list[Motion | None]:
        """Of each of `z` `[point, parameter]`, None where it is not known."""
        return [self._known.get(_key(*row)) for row in zip(z, free, strict=True)]

    def keep(self, z: np.ndarray, free: np.ndarray, motion: Motion) -> None:
        """Keeps those of few points."""
        if len(z) > FEW_POINTS:
            return
        for i, row in enumerate(zip(z, free, strict=True)):
            count = int(row[1].sum())
            position, velocity, *slopes = (leaf[i] for leaf in motion)
            slopes = (leaf[:count].copy() for leaf in slopes)
            self._known[_key(*row)] = position.copy(), velocity.copy(), *slopes
        while len(self._known) > MOST_POINTS:
            self._known.popitem(last=False)


def put_together(known: Sequence[Motion | None], new: Motion | None, width: int) -> Motion:
    """The motions of all points, `[point, ...]`, slopes `[point, width, ...]`.

    Args:
      known: of each point, None where it is among the new.
      new: `[new point, ...]`, in the same order.
      width: of the slopes: as many parameters, or more than are free.
    """
    first = next(one for one in known if one is not None)
    is_new = np.array([one is None for one in known])
    whole = []
    for i, leaf in enumerate(first):
        shape = leaf.shape if i < 2 else (width, *leaf.shape[1:])
        found = np.zeros((len(known), *shape))
        if new is not None:
            found[is_new] = new[i]
        for row, one in zip(found, known, strict=True):
            if one is not None:
                row[: len(one[i])] = one[i]
        whole.append(found)
    return tuple(whole)


def _key(z: np.ndarray, free: np.ndarray) -> bytes:
    return z.tobytes() + free.tobytes()
