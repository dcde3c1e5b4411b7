"""Clips with known truth, drawn: textured objects on a ramp and a table, filmed imperfectly.

`render_frames` takes a motion (times, positions, pitch) and knows nothing of where it came
from. What the camera is (`Camera`), what is in the picture (`Body`, `Ramp`) and how badly it
is filmed (`Filming`: noise, flicker, motion blur, a hand, faults) are told apart.
"""

from galileo_jax.video.synthetic.filming import Camera, Filming, Hand
from galileo_jax.video.synthetic.render import Motion, Ramp, render_frames, write_clip
from galileo_jax.video.synthetic.textures import Body

__all__ = ["Body", "Camera", "Filming", "Hand", "Motion", "Ramp", "render_frames", "write_clip"]
