"""The commands: they parse a call, carry it out and print what came of it.

What stands beside the core registers here: the data set Physics 101, and the thesis's preset.
"""

import galileo_jax.physics101
import galileo_jax.thesis  # noqa: F401
