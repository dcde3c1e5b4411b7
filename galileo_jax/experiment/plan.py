"""The rules of a discovery: what a lab is asked, what is left alone, and when it is enough."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from galileo_jax.experiment.settings import Can, check_can, grid, known_as

VARIED = ("height", "release", "angle", "fps", "place2")
# A verdict is believed when it has stood so many rounds, each with another clip; what is faint or
# nameless longer than what is named. An ambiguous one never is.
STANDS = {"named": 2, "law": 2, "none": 3, "unknown": 4}


def parted(can: Can) -> tuple[Can, dict[str, Any]]:
    """What is varied, and the values of what is held.

    Clips diagnosed together are trials of the same objects in their places: masses and the order
    of the objects stay, and so does what nobody here knows the meaning of.

    Raises:
      InputError: what is varied is out of all bounds.
    """
    varied = {name: kind for name, kind in can.items() if known_as(name) in VARIED}
    if "height" in map(known_as, varied):
        varied = {name: kind for name, kind in varied.items() if known_as(name) != "release"}
    check_can(varied)
    held = {name: kind.middle for name, kind in can.items() if name not in varied}
    held |= {name: False for name in held if known_as(name) == "swap"}
    return varied, held


def middle(can: Can) -> dict[str, Any]:
    """The middle of everything."""
    return {name: kind.middle for name, kind in can.items()}


def candidates(can: Can, tried: Sequence[Mapping[str, Any]], seed: int) -> list[dict[str, Any]]:
    """Settings to choose among: a grid, without those at which experiments came to nothing."""
    every = grid(can, seed)
    return [one for one in every if one not in tried] or every


def farthest(
    can: Can, settings: Sequence[Mapping[str, Any]], tried: Sequence[Mapping[str, Any]]
) -> Mapping[str, Any]:
    """Of some settings the one least like all that were tried."""
    here, there = _unit(can, settings), _unit(can, tried)
    apart = np.linalg.norm(here[:, None] - there[None], axis=-1).min(axis=1)
    return settings[int(np.argmax(apart))]


def stands(rounds: Sequence[Mapping[str, Any]]) -> bool:
    """Whether the last verdict has stood for long enough to be believed.

    A law stands by its formula, as a push or as a change of friction: whether it is a force or an
    acceleration, of one object or of all, may change from clip to clip without its being another.
    """
    if not rounds:
        return False
    last = rounds[-1]
    needed = STANDS.get(last["status"])
    if needed is None or len(rounds) < needed:
        return False
    return all(_says(one) == _says(last) for one in rounds[-needed:])


def _says(one: Mapping[str, Any]) -> tuple[str, Any]:
    """What a verdict is and what it is about."""
    law = one.get("law") if one["status"] == "law" else None
    if law is None:
        return one["status"], one["effects"]
    # What a formula changes stands in its effect's name (`laws.grammar.name_of`). One passage does
    # not tell a push from a change of friction; passages at several slopes do.
    is_friction = [name.startswith("law_friction_") for name in one["effects"]]
    return one["status"], (law["family"], is_friction)


def _unit(can: Can, settings: Sequence[Mapping[str, Any]]) -> np.ndarray:
    """Settings as points of the unit cube, `[setting, axis]`."""
    return np.array([[kind.share(one[name]) for name, kind in can.items()] for one in settings])
