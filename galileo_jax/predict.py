"""`python -m galileo_jax.predict`: the same as `galileo predict`."""

from galileo_jax.__main__ import run_verb

run_verb(__name__, "predict")
