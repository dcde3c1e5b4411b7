"""Every effect beside the model without effects; every pair beside the better of its effects."""

from itertools import combinations

from galileo_jax.search.starts import beside
from galileo_jax.search.table import Start, Table

NAME = "add"


def propose(table: Table) -> list[Start]:
    """Starts that match what the hypothesis without the effect leaves, and scattered ones."""
    if not table.most_effects:
        return []
    base = table.base
    wanted = [(base, (name,)) for name in table.trials.all_effects]
    if table.most_effects > 1:
        wanted += [
            (one, (*one.effects, *other.effects)) for one, other in combinations(table.named(1), 2)
        ]
    return beside(table, NAME, wanted)
