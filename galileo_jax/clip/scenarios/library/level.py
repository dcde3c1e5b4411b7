"""Level: along a level table, alone, slower and slower.

Whoever pushed it did so before the first frame that is used: how fast it is there is unknown.
"""

from galileo_jax.clip.scenarios import Scenario, register

register(
    Scenario(
        name="level",
        meaning="one object slides along a level table, no ramp",
        has_ramp=True,
        angle_deg=0.0,
        line="level",
        laws=("start_velocity",),
        without=(
            "initial_push",  # start_velocity
            "release_delay",  # start_velocity: it moves when the clip begins
            "scale_error",  # another gravity: friction alone says the same
            "static_friction",  # nothing is let go
        ),
    )
)
