"""`python -m galileo_jax.compare`: the same as `galileo compare`."""

from galileo_jax.__main__ import run_verb

run_verb(__name__, "compare")
