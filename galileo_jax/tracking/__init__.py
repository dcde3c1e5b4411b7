"""Following objects through a video, to hundredths of a pixel, with an honest error."""

from galileo_jax.tracking.clip import track_clip
from galileo_jax.tracking.track import Track
from galileo_jax.tracking.tracker import Start, track_video

__all__ = ["Start", "Track", "track_clip", "track_video"]
