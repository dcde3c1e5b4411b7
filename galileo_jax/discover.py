"""`python -m galileo_jax.discover`: the same as `galileo discover`."""

from galileo_jax.__main__ import run_verb

run_verb(__name__, "discover")
