"""`python -m galileo_jax.look`: the same as `galileo look`."""

from galileo_jax.__main__ import run_verb

run_verb(__name__, "look")
