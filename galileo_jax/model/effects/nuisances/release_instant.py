"""Release instant: the object is let go between two frames, not on one.

Shifts the model's clock: t <- t - release_instant.

What moves already when it is first seen has its clock's zero there.
"""

from galileo_jax.model.effects import Effect, Normal, Parameter


class ReleaseInstant(Effect):
    name = "release_instant"

    def parameters(self, scene):
        if scene.starts_moving:
            return ()
        return (
            Parameter("release_instant", "s", Normal(*scene.release_s), 0.0, "nuisance", step=None),
        )

    def time(self, time_s, theta, scene):
        start = scene.release_s[0] if scene.starts_moving else theta["release_instant"]
        return time_s - start
