"""Starts over all priors, where nothing is known or nothing explains the data.

The right valley may be narrow. Two effects have up to six constants: starts that serve for one
effect may all miss a valley, and a fit of one effect bends all else to do what the second one does.
"""

from itertools import combinations

from galileo_jax.search.hypothesis import Hypothesis
from galileo_jax.search.starts import scattered_starts
from galileo_jax.search.table import Start, Table

NAME = "scatter"
NUM_LEADERS, NUM_CROSSED = 3, 4
NUM_STARTS, NUM_FOLLOWED = 128, 8
NUM_FIRST, NUM_FIRST_FOLLOWED = 64, 4  # where nothing is known yet


def propose(table: Table) -> list[Start]:
    """The model that is fitted, or the leading pairs; only the first time while one explains."""
    if not table.entries:
        return _scattered(table, None, (), NUM_FIRST, NUM_FIRST_FOLLOWED)
    sets = [()] if table.is_in_doubt else _pairs(table)
    return [
        start
        for parent, effects in table.not_asked(NAME, [(table.base, effects) for effects in sets])
        for start in _scattered(table, parent, effects, NUM_STARTS, NUM_FOLLOWED)
    ]


def _pairs(table: Table) -> list[tuple[str, ...]]:
    """The leading pairs, and all pairs of the best single effects; none while one explains."""
    pairs = table.named(2)
    every = [entry.hypothesis for entry in table.entries.values()]
    if table.most_effects < 2 or not pairs or any(map(table.is_explained, every)):
        return []
    crossed = combinations(table.named(1)[:NUM_CROSSED], 2)
    sets = [
        *(pair.effects for pair in pairs[:NUM_LEADERS]),
        *((*one.effects, *other.effects) for one, other in crossed),
    ]
    return list({frozenset(effects): effects for effects in sets}.values())


def _scattered(
    table: Table, parent: Hypothesis | None, effects: tuple[str, ...], num: int, num_followed: int
) -> list[Start]:
    """Starts of one hypothesis, of which so many are followed."""
    starts = scattered_starts(
        table.trials, table.free([effects])[0], num, table.seed + table.num_rounds
    )
    return [
        Start(effects, z, parent, NAME, number % num_followed) for number, z in enumerate(starts)
    ]
