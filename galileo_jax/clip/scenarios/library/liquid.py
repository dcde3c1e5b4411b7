"""Liquid: sinking or rising in a liquid, with buoyancy, drag and the liquid carried along."""

from galileo_jax.clip.scenarios import Scenario, register

register(
    Scenario(
        name="liquid",
        meaning="one object sinks or rises in a liquid",
        line="down",
        up_shows="sink",
        laws=("liquid", "start_velocity"),
        without=(
            "air_drag",  # liquid_drag
            "constant_force",  # density_ratio
            "frame_rate",  # density_ratio and liquid_drag together
            "initial_push",  # start_velocity
            "release_delay",  # start_velocity
            "scale_error",  # density_ratio and liquid_drag together
        ),
        keys=("liquid_density",),
    )
)
