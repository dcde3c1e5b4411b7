"""Experiments with known truth: what is in them, how they move, what is said of them.

`draw_truth` draws an experiment, `hide` puts an effect into it, `roll_out` lets it happen,
and `Declared` is what a user would write down about it.
"""

from galileo_jax.simulation.declared import Declared
from galileo_jax.simulation.free import FreeTruth, draw_free, hide_free, solve_free
from galileo_jax.simulation.hidden import Hidden, hide
from galileo_jax.simulation.motion import LONGEST_S, SOLVERS, Motion, Solver, roll_out
from galileo_jax.simulation.record import truth_record
from galileo_jax.simulation.series import draw_series
from galileo_jax.simulation.truth import SLOWEST_HIT_M_S, Truth, draw_truth

__all__ = [
    "LONGEST_S",
    "SLOWEST_HIT_M_S",
    "SOLVERS",
    "Declared",
    "FreeTruth",
    "Hidden",
    "Motion",
    "Solver",
    "Truth",
    "draw_free",
    "draw_series",
    "draw_truth",
    "hide",
    "hide_free",
    "roll_out",
    "solve_free",
    "truth_record",
]
