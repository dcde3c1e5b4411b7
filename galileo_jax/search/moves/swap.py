"""Another effect in place of one: what does the same leaves all else where the leader has it."""

from galileo_jax.search.hypothesis import Hypothesis, reduced
from galileo_jax.search.start import Start
from galileo_jax.search.starts import beside
from galileo_jax.search.table import Table

NAME = "swap"
NUM_LEADERS = 1


def propose(table: Table) -> list[Start]:
    """Starts that match what the leading hypothesis, without one of its effects, leaves."""
    wanted: list[tuple[Hypothesis, tuple[str, ...]]] = []
    for leader in table.leaders(NUM_LEADERS):
        for one in leader.effects:
            kept = tuple(name for name in leader.effects if name != one)
            others = table.library if kept else table.trials.all_effects
            parent = reduced(table.trials, leader, kept)
            wanted += [(parent, (*kept, name)) for name in others if name not in leader.effects]
    return beside(table, NAME, wanted, is_scattered=len(wanted[0][1]) > 1) if wanted else []
