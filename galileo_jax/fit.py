"""`python -m galileo_jax.fit`: the same as `galileo fit`."""

from galileo_jax.__main__ import run_verb

run_verb(__name__, "fit")
