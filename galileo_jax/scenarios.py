"""`python -m galileo_jax.scenarios`: the same as `galileo scenarios`."""

from galileo_jax.__main__ import run_verb

run_verb(__name__, "scenarios")
