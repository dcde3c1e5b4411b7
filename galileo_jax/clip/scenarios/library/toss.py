"""Toss: a box is thrown onto a table, with poses from frame to frame (`clip/poses_csv.py`).

`fit_tosses` takes all of it. To the other commands it is a flight in space of the centre, up to the
first impact.
"""

from galileo_jax.clip.scenarios import Scenario, register
from galileo_jax.clip.scenarios.library.flight import WITHOUT

register(
    Scenario(
        name="toss",
        meaning="one box is thrown onto a table, and its turning was measured, too",
        moves_in_plane=True,
        laws=("start_velocity",),
        without=(*WITHOUT, "camera_roll", "constant_force"),  # indoors, poses of several cameras
    )
)
