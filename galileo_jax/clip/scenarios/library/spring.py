"""Spring: hung on a spring, up and down.

The motion tells the period and the damping, whatever the scale; stiffness takes the mass.
"""

from galileo_jax.clip.scenarios import Scenario, register

register(
    Scenario(
        name="spring",
        meaning="one object hangs on a spring and swings up and down",
        has_ramp=False,
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
