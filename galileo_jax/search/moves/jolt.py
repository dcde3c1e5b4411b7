"""Positive nuisances moved across their valleys, all else as in a fit.

A small coefficient of restitution decides whether bodies part and meet again, so that the misfit
has a valley on either side.
"""

from galileo_jax.search.start import Start
from galileo_jax.search.table import BASE, Table

NAME = "jolt"
MOST_JOLTED = 6  # those that the loop refines with care


def propose(table: Table) -> list[Start]:
    """Of the hypotheses that may decide, the fit with hardly any, a little and a lot of each."""
    rows = [table.entries[key].hypothesis for key in table.deciding() if key != BASE]
    wanted = table.not_asked(NAME, [(one, one.effects) for one in rows[:MOST_JOLTED]])
    return [
        Start(one.effects, z, one, NAME, number, is_near=True)
        for one, _ in wanted
        for number, z in enumerate(table.fitter.with_variants(one.fit)[1:])
    ]
