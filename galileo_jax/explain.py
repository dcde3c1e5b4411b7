"""`python -m galileo_jax.explain`: the same as `galileo explain`."""

from galileo_jax.__main__ import run_verb

run_verb(__name__, "explain")
