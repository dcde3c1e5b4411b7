"""Constant force: something pulls object 1 all the time, downhill and away from the ramp positive.

    F = constant_force      along the path: a thread that is led along it, a fan on a cart,
    F = constant_force      level: a wind, a thread over a pulley beyond the table.

On the table both are the same. On the ramp F cos a of the level one acts along the path, and
F sin a lifts the object off and lightens what rubs. `constant_force_levelness` is 0 for the one and
1 for the other.

Source: Newton, Principia, law II (1687).
Confused with: k1, entirely where there is one slope: k_1 -> k_1 - F / (m g cos a) moves alike.
Ramp and table together tell them apart by 1 - cos a only, which is less than what the direction
changes; a body at rest, or one that comes back up, does better.
"""

from galileo_jax.model.effects.effect import (
    Array,
    Effect,
    Force,
    Friction,
    State,
    Surroundings,
    Theta,
)
from galileo_jax.model.effects.registry import register
from galileo_jax.model.parameters import Normal, Parameter

PRIOR = Normal(0.0, 0.5)
LEVELNESS_PRIOR = Normal(0.5, 0.5)  # along the path or level: both one sd from the middle


@register
class ConstantForce(Effect):
    """A steady force on object 1."""

    name = "constant_force"

    def parameters(self, scene: Surroundings) -> tuple[Parameter, ...]:
        """The force, and before a foot how level it is on the ramp."""
        pull = Parameter("constant_force", "N", PRIOR, 0.0, "effect", 0.05)
        if not scene.crosses_foot:
            return (pull,)
        usual = LEVELNESS_PRIOR.mean  # means nothing while the force is absent
        levelness = Parameter(
            "constant_force_levelness", "1", LEVELNESS_PRIOR, usual, "effect", 0.1
        )
        return (pull, levelness)

    def force(self, theta: Theta, scene: Surroundings) -> Force:
        """The force along the path."""
        pull = scene.only(theta["constant_force"], 0)
        if not scene.crosses_foot:
            return lambda state: pull
        xp = pull.__array_namespace__()
        less = theta["constant_force_levelness"][..., None] * (xp.cos(scene.angle_rad) - 1.0)

        def steady(state: State) -> Array:
            return pull * (1.0 + _on_ramp(state) * less)

        return steady

    def friction(self, theta: Theta, scene: Surroundings) -> Friction | None:
        """The coefficients, less by what of the weight a level force carries on the ramp."""
        if not scene.crosses_foot or not scene.has_surface:
            return None
        pull = scene.only(theta["constant_force"], 0)
        xp = pull.__array_namespace__()
        level = theta["constant_force_levelness"][..., None]
        carried = level * pull * xp.tan(scene.angle_rad) / scene.weight(theta)

        def law(state: State, k: Array) -> Array:
            return xp.maximum(k * (1.0 - _on_ramp(state) * carried), xp.zeros_like(k))

        return law


def _on_ramp(state: State) -> Array:
    return state.is_on_ramp.astype(state.path_m.dtype)
