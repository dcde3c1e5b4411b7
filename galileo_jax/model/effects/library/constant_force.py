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

from galileo_jax.model.effects import (
    Array,
    Effect,
    Normal,
    Parameter,
    State,
    not_negative,
    register,
)

PRIOR = Normal(0.0, 0.5)
LEVELNESS_PRIOR = Normal(0.5, 0.5)  # along the path or level: both one sd from the middle


@register
class ConstantForce(Effect):
    name = "constant_force"

    def parameters(self, scene):
        pull = Parameter("constant_force", "N", PRIOR, 0.0, "effect", 0.05)
        name, prior = "constant_force_levelness", LEVELNESS_PRIOR
        # It means nothing while the force is absent.
        levelness = Parameter(name, "1", prior, prior.mean, "effect", 0.1)
        return (pull, levelness) if scene.crosses_foot else (pull,)

    def force(self, theta, scene):
        pull = scene.only(theta["constant_force"], 0)
        if not scene.crosses_foot:
            return lambda state: pull
        xp = pull.__array_namespace__()
        less = theta["constant_force_levelness"][..., None] * (xp.cos(scene.angle_rad) - 1.0)
        return lambda state: pull * (1.0 + _on_ramp(state) * less)

    def friction(self, theta, scene):
        if not scene.crosses_foot or not scene.has_surface:
            return None
        pull = scene.only(theta["constant_force"], 0)
        xp = pull.__array_namespace__()
        level = theta["constant_force_levelness"][..., None]
        carried = level * pull * xp.tan(scene.angle_rad) / scene.weight(theta)
        return lambda state, k: not_negative(k * (1.0 - _on_ramp(state) * carried))


def _on_ramp(state: State) -> Array:
    return state.is_on_ramp.astype(state.path_m.dtype)
