"""The thesis that this package began with, on our rollouts: its sampler, scores and network.

It stands beside the core: it uses the core's rooms, and none of them imports it. Importing it makes
its preset known to `galileo train`, and its setting to the tests of trained networks.
"""

from galileo_jax.neural.task import BENCHMARKS, PRESETS

PRESETS.extend("galileo_jax.thesis.task")
BENCHMARKS.extend("galileo_jax.thesis.clips")
