"""Release instant: the object is let go between two frames, not on one."""

from galileo_jax.model.effects.effect import Array, Effect, Surroundings, Theta
from galileo_jax.model.parameters import Normal, Parameter


class ReleaseInstant(Effect):
    """Shifts the model's clock: t <- t - release_instant.

    What moves already when it is first seen has its clock's zero there.
    """

    name = "release_instant"

    def parameters(self, scene: Surroundings) -> tuple[Parameter, ...]:
        """The instant of the release after the first frame, s; none where nothing is let go."""
        if scene.starts_moving:
            return ()
        return (
            Parameter("release_instant", "s", Normal(*scene.release_s), 0.0, "nuisance", step=None),
        )

    def time(self, time_s: Array, theta: Theta, scene: Surroundings) -> Array:
        """The time since the release."""
        start = scene.release_s[0] if scene.starts_moving else theta["release_instant"]
        return time_s - start
