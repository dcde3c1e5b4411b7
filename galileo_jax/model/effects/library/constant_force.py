"""Constant force: something pulls all the time, downhill and away from the ramp positive.

    F = constant_force      along the path: a thread that is led along it, a fan on a cart,
    F = constant_force      level: a wind, a thread over a pulley beyond the table.

On the table both are the same. On the ramp F cos a of the level one acts along the path, and
F sin a lifts the object off and lightens what rubs. `constant_force_levelness` is 0 for the one and
1 for the other. Object 1 is pulled, and each other object by `constant_force_on_others` times as
much: 0 of a thread, 1 of a wind. On what is thrown it is level in the picture, and has no place in
space, where a lift is as steady.

Source: Newton, Principia, law II (1687).
Confused with: k1, entirely where there is one slope: k_1 -> k_1 - F / (m g cos a) moves alike.
Ramp and table together tell them apart by 1 - cos a only, which is less than what the direction
changes; a body at rest, or one that comes back up, does better. k2 in the same way, entirely where
object 2 only moves forward. In the air camera_roll, but for g (1 - cos r).
"""

from galileo_jax.model.effects import (
    Array,
    Effect,
    Normal,
    Parameter,
    State,
    Surroundings,
    not_negative,
    register,
)

PRIOR = Normal(0.0, 0.5)
# Along the path or level, on object 1 or on all: either is one sd from the middle.
EITHER_PRIOR = Normal(0.5, 0.5)
LEVELNESS, ON_OTHERS = "constant_force_levelness", "constant_force_on_others"


@register
class ConstantForce(Effect):
    name = "constant_force"

    def parameters(self, scene):
        pull = Parameter(self.name, "N", PRIOR, 0.0, "effect", 0.05)
        if scene.is_thrown:
            return (pull,) if scene.num_axes == 2 else ()
        # They mean nothing while the force is absent.
        asked = {LEVELNESS: scene.crosses_foot, ON_OTHERS: len(scene.names) > 1}
        shares = [
            Parameter(name, "1", EITHER_PRIOR, EITHER_PRIOR.mean, "effect", 0.1)
            for name, is_asked in asked.items()
            if is_asked
        ]
        return (pull, *shares)

    def force(self, theta, scene):
        if scene.is_thrown:
            return None
        pull = _pull(theta, scene)
        if not scene.crosses_foot:
            return lambda state: pull
        xp = pull.__array_namespace__()
        less = theta[LEVELNESS][..., None] * (xp.cos(scene.angle_rad) - 1.0)
        return lambda state: pull * (1.0 + _on_ramp(state) * less)

    def friction(self, theta, scene):
        if not scene.crosses_foot or not scene.has_surface:
            return None
        pull = _pull(theta, scene)
        xp = pull.__array_namespace__()
        level = theta[LEVELNESS][..., None]
        carried = level * pull * xp.tan(scene.angle_rad) / scene.weight(theta)
        return lambda state, k: not_negative(k * (1.0 - _on_ramp(state) * carried))

    def push(self, theta, scene):
        if not scene.is_thrown or scene.num_axes > 2:
            return None
        pull = theta[self.name]
        force = pull.__array_namespace__().stack([pull, 0.0 * pull])
        return lambda velocity_m_s, time_s: force


def _pull(theta, scene: Surroundings) -> Array:
    """On each object along its path, N, `[..., object]`."""
    first = scene.only(theta["constant_force"], 0)
    if len(scene.names) == 1:
        return first
    others = range(1, len(scene.names))
    return first + scene.only(theta["constant_force"] * theta[ON_OTHERS], *others)


def _on_ramp(state: State) -> Array:
    return state.is_on_ramp.astype(state.path_m.dtype)
