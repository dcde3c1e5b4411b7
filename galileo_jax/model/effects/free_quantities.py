"""Declared quantities that a fit may infer, by name: `--free gravity`.

Each is an effect that is always there and in no question. Its parameter has the role "main", and
the declared value in its prior.
"""

from collections.abc import Sequence

from galileo_jax.model.effects.effect import Effect
from galileo_jax.model.parameters import LogNormal, Parameter
from galileo_jax.runtime.errors import InputError
from galileo_jax.runtime.known_names import check_known

GRAVITY_SD = 0.2  # of the logarithm: 8.0 to 12.0 m/s^2 where 9.81 is declared


class Gravity(Effect):
    """The acceleration of free fall is measured, not declared.

    A fall or a flight of known scale and frame rate determines it. On a slope only
    g (sin a - k cos a) shows: a level table after it, or slopes of several angles, separate g from
    the friction k. Whatever scales lengths or times (`pixels_per_metre`, `scale_error`,
    `frame_rate`) acts like another g.

    Source: Galilei, Discorsi (1638), third day.
    """

    name = "gravity"

    def parameters(self, scene):
        prior = LogNormal(scene.gravity, GRAVITY_SD)
        return (Parameter("gravity", "m/s^2", prior, scene.gravity, "main", 0.05),)

    def gravity(self, theta, scene):
        return theta["gravity"]


FREE_QUANTITIES: tuple[Effect, ...] = (Gravity(),)


def make_free_quantities(names: Sequence[str]) -> tuple[Effect, ...]:
    """The effects that make these quantities parameters, in alphabetical order.

    Raises:
      InputError: a name is unknown (the message lists the known) or given twice.
    """
    for name in names:
        check_known("free", "quantity", name, [known.name for known in FREE_QUANTITIES])
        if names.count(name) > 1:
            raise InputError(f"free: {name!r} is named twice")
    return tuple(effect for effect in FREE_QUANTITIES if effect.name in names)
