"""Experiments with known truth: what is in them, how they move, what is said of them.

`draw_truth` draws an experiment, `hide` puts an effect into it, `roll_out` lets it happen,
and `Declared` is what a user would write down about it.
"""
