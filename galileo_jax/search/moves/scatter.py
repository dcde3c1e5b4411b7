"""Starts over all priors, where nothing explains the data: the right valley may be narrow.

Two effects have up to six constants. Starts that serve for one effect may all miss a valley, and a
fit of one effect bends all else to do what the second one does.
"""

from itertools import combinations

from galileo_jax.inference.fits.starts import scattered_starts
from galileo_jax.search.start import Start
from galileo_jax.search.table import Table

NAME = "scatter"
NUM_LEADERS, NUM_CROSSED = 3, 4
NUM_STARTS, NUM_FOLLOWED = 128, 8


def propose(table: Table) -> list[Start]:
    """The leading pairs, and all pairs of the best single effects; none while one explains."""
    pairs = table.named(2)
    every = [entry.hypothesis for entry in table.entries.values()]
    if (
        table.most_effects < 2
        or not pairs
        or any(table.fitter.is_explained(one.fit) for one in every)
    ):
        return []
    crossed = combinations(table.named(1)[:NUM_CROSSED], 2)
    sets = [
        *(pair.effects for pair in pairs[:NUM_LEADERS]),
        *((*one.effects, *other.effects) for one, other in crossed),
    ]
    each = {frozenset(effects): effects for effects in sets}
    wanted = table.not_asked(NAME, [(table.base, effects) for effects in each.values()])
    return (
        [
            Start(effects, z, parent, NAME, number % NUM_FOLLOWED)
            for (parent, effects), free in zip(
                wanted, table.free([e for _, e in wanted]), strict=True
            )
            for number, z in enumerate(
                scattered_starts(table.trials, free, NUM_STARTS, table.seed + table.num_rounds)
            )
        ]
        if wanted
        else []
    )
