"""`python -m galileo_jax.track`: the same as `galileo track`."""

from galileo_jax.__main__ import run_verb

run_verb(__name__, "track")
