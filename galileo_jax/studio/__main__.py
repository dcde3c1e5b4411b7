"""`python -m galileo_jax.studio`: the same as `galileo studio`."""

from galileo_jax.__main__ import run_verb

run_verb(__name__, "studio")
