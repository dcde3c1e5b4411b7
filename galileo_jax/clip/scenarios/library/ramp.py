"""Ramp: the experiment of Galileo's ramp; object 1 slides down and may hit object 2."""

from galileo_jax.clip.scenarios import Scenario, register

register(
    Scenario(
        name="ramp",
        meaning="object 1 slides down a ramp onto a table",
        has_ramp=True,
        up_shows="drop",
        has_table=True,
        num_objects=(1, 2),
        keys=("starts_moving",),
    )
)
