"""A law written as one formula: what `galileo diagnose` proposes, and the shortest effect of all.

    push       a = c f                 along the path
    drag       a = -c f sign(v)        against the motion
    friction   k -> max(0, k (1 + c (f - f_0)))

with f a formula of the time t since the release, the place q along the path and the speed v (SI),
without a dimension, on object 1 or on all, and f_0 its value where the motion begins (t = 0, the
place of the release, at rest), so that k stays the friction there. `drag_force` is a drag of the
same force on all, as a liquid's: the acceleration of object i is m1/mi times that of object 1. Of
a drag c is positive.
"""

from collections.abc import Mapping
from typing import Any, ClassVar, Literal

from galileo_jax.model.effects.effect import (
    Array,
    Effect,
    Force,
    Friction,
    State,
    Surroundings,
    Theta,
    not_negative,
)
from galileo_jax.model.parameters import LogNormal, Normal, Parameter, Prior

Nature = Literal["push", "drag", "drag_force", "friction"]
SLOWEST_M_S = 0.01  # below it a drag's direction fades away, lest it push what rests
# A drag takes energy: its strength is positive. Of the size that the library's drags have.
DRAG = LogNormal(1.0, 1.2)
STRENGTH: Mapping[Nature, Prior] = {
    "push": Normal(0.0, 2.0),
    "drag": DRAG,
    "drag_force": DRAG,
    "friction": Normal(0.0, 1.0),
}


def against_motion(size: Array, speed_m_s: Array) -> Array:
    """A drag of a size, N, with its direction."""
    xp = speed_m_s.__array_namespace__()
    return -size * speed_m_s / xp.sqrt(speed_m_s * speed_m_s + SLOWEST_M_S**2)


def changed_friction(k: Array, value: Array) -> Array:
    """Coefficients k times 1 + value, but not negative."""
    return not_negative(k * (1.0 + value))


class Law(Effect):
    """One formula; subclasses give `name`, `nature`, `is_on_all`, `constants` and `formula`."""

    nature: ClassVar[Nature] = "push"
    is_on_all: ClassVar[bool] = False
    constants: ClassVar[Mapping[str, tuple[str, Prior]]] = {}
    """Of the formula, by name: unit and prior."""

    def formula(self, t: Any, q: Any, v: Any, xp: Any, **constants: Any) -> Array:
        """F at a time, at places and speeds, each `[..., object]`; `xp` is NumPy or JAX."""
        raise NotImplementedError

    def parameters(self, scene: Surroundings) -> tuple[Parameter, ...]:
        """The strength c and the formula's constants; none where friction has no surface."""
        if self.nature == "friction" and not scene.has_surface:
            return ()
        unit = "1" if self.nature == "friction" else "m/s^2"
        found = [Parameter(self.name, unit, STRENGTH[self.nature], 0.0, "effect", 0.1)]
        for name, (its_unit, prior) in self.constants.items():
            usual = float(prior.forward(0.0))  # pyright: ignore
            own = f"{self.name}_{name}"
            found.append(Parameter(own, its_unit, prior, usual, "effect", 0.1))
        return tuple(found)

    def force(self, theta: Theta, scene: Surroundings) -> Force | None:
        """Of pushes and drags, N."""
        if self.nature == "friction":
            return None
        value = self._value(theta, scene)
        masses = scene.mass(theta)
        xp = masses[0].__array_namespace__()
        mass = xp.stack(masses, axis=-1)
        if self.nature == "drag_force":
            mass = masses[0][..., None] + 0.0 * mass

        def act(state: State) -> Array:
            size = mass * value(state)
            return size if self.nature == "push" else against_motion(size, state.speed_m_s)

        return act

    def friction(self, theta: Theta, scene: Surroundings) -> Friction | None:
        """Of frictions, the coefficients."""
        if self.nature != "friction" or not scene.has_surface:
            return None
        value = self._value(theta, scene)

        return lambda state, k: changed_friction(k, value(state))

    def _value(self, theta: Theta, scene: Surroundings) -> Force:
        """C f on the objects it acts on, 0 on others."""
        strength = theta[self.name]
        xp = strength.__array_namespace__()
        count = len(scene.names)
        chosen = xp.asarray([1.0 if self.is_on_all or i == 0 else 0.0 for i in range(count)])
        own = {name: theta[f"{self.name}_{name}"][..., None] for name in self.constants}

        def value(state: State) -> Array:
            t = state.time_s + 0.0 * state.path_m
            f = self.formula(t, state.path_m, state.speed_m_s, xp, **own)
            if self.nature == "friction":
                begin = 0.0 * state.path_m + xp.asarray(scene.start_path_m)
                f = f - self.formula(0.0 * t, begin, 0.0 * state.speed_m_s, xp, **own)
            return strength[..., None] * chosen * f

        return value
