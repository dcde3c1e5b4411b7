"""Flight: thrown, in the plane of the picture, with gravity as a vector.

The first frame in which the object is free is the start; how fast and which way it goes there
is unknown. Gravity tells the scale where `pixels_per_metre` is null.
"""

from galileo_jax.clip.scenarios import Scenario, register

# What no thrown body's path shows; `toss` has the same.
WITHOUT = (
    "initial_push",  # start_velocity
    "release_delay",  # start_velocity: it flies when the clip begins
    "spring_tether",  # along the velocity
)

register(
    Scenario(
        name="flight",
        meaning="one object is thrown",
        up_shows="bend",
        moves_in_plane=True,
        laws=("start_velocity",),
        without=WITHOUT,
        keys=("floor", "launch_angle_deg", "vertical_sd_deg"),
    )
)
