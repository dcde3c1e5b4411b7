"""`python -m galileo_jax.toss`: the same as `galileo toss`."""

from galileo_jax.__main__ import run_verb

run_verb(__name__, "toss")
