"""`python -m galileo_jax.studio`: the same as `galileo studio`."""

from galileo_jax.__main__ import cli

cli("studio")
