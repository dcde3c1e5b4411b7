"""The commands: they parse a call, carry it out and print what came of it."""

import galileo_jax.api  # noqa: F401 - registers what stands beside the core
