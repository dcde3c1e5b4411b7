"""Incline: the board alone."""

from galileo_jax.clip.scenarios import Scenario, register

register(
    Scenario(
        name="incline",
        meaning="one object slides down a board, no table",
        has_ramp=True,
        line="slope",
        up_shows="drop",
        keys=("starts_moving",),
    )
)
