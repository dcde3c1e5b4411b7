"""Another effect in place of one: what does the same leaves all else where the leader has it."""

from galileo_jax.search.starts import beside
from galileo_jax.search.table import Start, Table

NAME = "swap"
NUM_LEADERS = 1


def propose(table: Table) -> list[Start]:
    """Starts that match what the leading hypothesis, without one of its effects, leaves."""
    wanted = [(parent, effects) for _, _, parent, effects in table.replacements(NUM_LEADERS)]
    return beside(table, NAME, wanted, is_scattered=len(wanted[0][1]) > 1) if wanted else []
