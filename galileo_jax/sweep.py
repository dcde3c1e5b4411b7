"""`python -m galileo_jax.sweep`: the same as `galileo sweep`."""

from galileo_jax.__main__ import run_verb

run_verb(__name__, "sweep")
