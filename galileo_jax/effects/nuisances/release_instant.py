"""Release instant: the object is let go between two frames, not on one."""

from typing import ClassVar

from galileo_jax.effects.effect import Array, Effect, Surroundings, Theta
from galileo_jax.parameters import Normal, Parameter


class ReleaseInstant(Effect):
    """Shifts the model's clock: t <- t - release_instant."""

    name: ClassVar[str] = "release_instant"

    def parameters(self, scene: Surroundings) -> tuple[Parameter, ...]:
        """The instant of the release after the first frame, s."""
        return (
            Parameter("release_instant", "s", Normal(*scene.release_s), 0.0, "nuisance", step=None),
        )

    def time(self, time_s: Array, theta: Theta, scene: Surroundings) -> Array:
        """The time since the release."""
        return time_s - theta["release_instant"]
