"""`python -m galileo_jax.effects`: the same as `galileo effects`."""

from galileo_jax.__main__ import run_verb

run_verb(__name__, "effects")
