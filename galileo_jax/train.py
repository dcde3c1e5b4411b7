"""`python -m galileo_jax.train`: the same as `galileo train`."""

from galileo_jax.__main__ import run_verb

run_verb(__name__, "train")
