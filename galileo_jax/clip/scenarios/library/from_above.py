"""From above: pucks that slide, turn and hit each other on a level table, seen from above."""

from galileo_jax.clip.scenarios import Scenario, register

register(
    Scenario(
        name="from_above",
        meaning="pucks slide on a level table and hit each other, seen from above",
        num_objects=(1, None),
        is_level=True,
        moves_in_plane=True,
        laws=("pucks",),
        without=(
            "camera_roll",  # gravity points into the picture
            "constant_force",  # along the velocity: nothing pushes so
            "initial_push",  # the pucks' own start velocities
            "magnus",  # nothing flies
            "ramp_angle",  # no ramp
            "release_delay",  # they move when the clip begins
            "restitution",  # the pucks' own
            "rolling",  # discs lie flat
            "scale_error",  # another gravity: friction alone says the same
            "spring_tether",  # along the velocity
            "static_friction",  # what rests is pushed by nothing
        ),
        keys=("walls", "turning"),
    )
)
