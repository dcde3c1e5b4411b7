"""Spring: to and fro on a spring, hung or along a level track.

The motion tells the period and the damping, whatever the scale; stiffness takes the mass.
"""

from galileo_jax.clip.scenarios import Scenario, register

register(
    Scenario(
        name="spring",
        meaning="one object swings on a spring, hung or along a level track",
        line="down",
        laws=("spring", "start_velocity"),
        without=(
            "constant_force",  # the place of rest
            "frame_rate",  # the period
            "initial_push",  # start_velocity
            "release_delay",  # start_velocity
            "scale_error",  # the size of the swing
            "spring_tether",  # the spring
            "viscous_drag",  # the damping
        ),
    )
)
