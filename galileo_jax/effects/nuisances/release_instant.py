"""Release instant: the object is let go between two frames, not on one."""

from typing import ClassVar

from galileo_jax.effects.effect import Array, Effect, Surroundings, Theta
from galileo_jax.parameters import Normal, Parameter

SD_S = 0.01  # a third of a frame at 30 fps, exposure included


class ReleaseInstant(Effect):
    """Shifts the model's clock: t <- t - release_instant."""

    name: ClassVar[str] = "release_instant"

    def parameters(self, scene: Surroundings) -> tuple[Parameter, ...]:
        """The instant of the release after the first frame, s."""
        return (
            Parameter("release_instant", "s", Normal(0.0, SD_S), 0.0, "nuisance", 0.1),
        )

    def time(self, time_s: Array, theta: Theta, scene: Surroundings) -> Array:
        """The time since the release."""
        return time_s - theta["release_instant"]
