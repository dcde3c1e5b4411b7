"""`python -m galileo_jax.label`: the same as `galileo label`."""

from galileo_jax.__main__ import run_verb

run_verb(__name__, "label")
