"""`python -m galileo_jax.diagnose`: the same as `galileo diagnose`."""

from galileo_jax.__main__ import run_verb

run_verb(__name__, "diagnose")
