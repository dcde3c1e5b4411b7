"""What the package offers to Python.

What stands beside the core registers here: the data set Physics 101, and the thesis's preset.
"""

import galileo_jax.physics101
import galileo_jax.thesis  # noqa: F401
