"""`python -m galileo_jax.simulate`: the same as `galileo simulate`."""

from galileo_jax.__main__ import run_verb

run_verb(__name__, "simulate")
