"""`python -m galileo_jax.export`: the same as `galileo export`."""

from galileo_jax.__main__ import run_verb

run_verb(__name__, "export")
