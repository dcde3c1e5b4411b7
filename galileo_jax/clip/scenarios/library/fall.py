"""Fall: straight down from rest, onto a floor where the clip has one."""

from galileo_jax.clip.scenarios import Scenario, register

register(
    Scenario(
        name="fall",
        meaning="one object is dropped",
        line="down",
        up_shows="bend",
        keys=("floor", "starts_moving"),
    )
)
