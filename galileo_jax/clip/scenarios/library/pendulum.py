"""Pendulum: a bob on a thread or a rod, in the plane of the picture, however far it swings.

Gravity and the period tell the length, whatever the scale; the path tells where the pivot is.
"""

from galileo_jax.clip.scenarios import Scenario, register

register(
    Scenario(
        name="pendulum",
        meaning="one object swings on a thread or a rod",
        line="aside",
        up_shows="sag",
        moves_in_plane=True,
        laws=("pendulum", "start_velocity"),
        without=(
            "constant_force",  # along the velocity: nothing pushes so
            "initial_push",  # start_velocity
            "magnus",  # the thread holds it in the plane
            "release_delay",  # start_velocity: it swings when the clip begins
            "spring_tether",  # along the velocity
        ),
        keys=("thread_m", "pivot_m", "vertical_sd_deg"),
    )
)
