"""Multi: the ramp with any number of objects on the table."""

from galileo_jax.clip.scenarios import Scenario, register

register(
    Scenario(
        name="multi",
        meaning="object 1 slides down a ramp onto a table, into others",
        has_ramp=True,
        up_shows="drop",
        has_table=True,
        num_objects=(1, None),
        keys=("starts_moving",),
    )
)
