"""The Physics 101 data set (Wu et al., BMVC 2016) as a source of clips.

It stands beside the core: it uses the core's rooms, and none of them imports it. Importing it lets
`load_clip` and sweeps take the data set's videos by their path.
"""

from galileo_jax.clip.sources import SOURCES

SOURCES.extend("galileo_jax.physics101.source")
