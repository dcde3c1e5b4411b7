"""Laws that neither the library nor the forms have, made by hand for `laws.py`.

Each is one line: the acceleration along the path, m/s^2, of an object at time t, place q and
speed v, for a strength of one; or what the friction coefficient is multiplied by. Accelerations
act on object 1, drags and frictions on all.
"""

from collections.abc import Callable
from typing import Any, ClassVar, Literal, NamedTuple

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
from galileo_jax.model.parameters import LogNormal, Parameter


class HiddenLaw(NamedTuple):
    """A law and what counts as having found it.

    Attributes:
      kind: push (on object 1), drag (against the motion, on all) or friction (k times 1 + f).
      formula: of t, q, v and the array module.
      size: of the strength, median.
      variables: that it depends on.
      power: of the only variable; None where it is no power.
    """

    kind: Literal["push", "drag", "friction"]
    formula: Callable[[Any, Any, Any, Any], Any]
    size: float
    variables: str
    power: float | None = None


def _bell(u: Any, xp: Any) -> Any:
    return xp.exp(-(u**2))


LAWS = {
    "root_of_time": HiddenLaw("push", lambda t, q, v, xp: xp.sqrt(t + 1e-9), 1.2, "t", 0.5),
    "square_of_time": HiddenLaw("push", lambda t, q, v, xp: t**2, 2.0, "t", 2.0),
    "drag_1_5": HiddenLaw("drag", lambda t, q, v, xp: abs(v) ** 1.5, 0.8, "v", 1.5),
    "drag_3": HiddenLaw("drag", lambda t, q, v, xp: abs(v) ** 3, 0.8, "v", 3.0),
    "drag_0_5": HiddenLaw("drag", lambda t, q, v, xp: xp.sqrt(abs(v) + 1e-9), 0.8, "v", 0.5),
    "heating": HiddenLaw("friction", lambda t, q, v, xp: t, 1.0, "t", 1.0),
    "cooling": HiddenLaw("friction", lambda t, q, v, xp: xp.exp(-t / 0.2), 1.5, "t"),
    "gust": HiddenLaw("push", lambda t, q, v, xp: _bell((t - 0.4) / 0.06, xp), 3.0, "t"),
    "slow_gust": HiddenLaw("push", lambda t, q, v, xp: _bell((t - 0.35) / 0.15, xp), 1.5, "t"),
    "shaking": HiddenLaw("push", lambda t, q, v, xp: xp.sin(2 * xp.pi * t / 0.21), 1.5, "t"),
    "dying_wind": HiddenLaw("push", lambda t, q, v, xp: xp.exp(-t / 0.25), 1.5, "t"),
    "fan_switched_on": HiddenLaw("push", lambda t, q, v, xp: t > 0.4, 1.0, "t"),
    "drying": HiddenLaw("friction", lambda t, q, v, xp: t > 0.45, 0.8, "t"),
    "ripple": HiddenLaw("friction", lambda t, q, v, xp: xp.sin(2 * xp.pi * q / 0.17), 0.8, "q"),
    "polished": HiddenLaw("friction", lambda t, q, v, xp: xp.exp(4.0 * q), 1.5, "q"),
    "worn": HiddenLaw("friction", lambda t, q, v, xp: q, -1.5, "q", 1.0),
    "magnet": HiddenLaw(
        "push", lambda t, q, v, xp: -(q + 0.1) / 0.05 / (1 + ((q + 0.1) / 0.05) ** 2) ** 2, 4.0, "q"
    ),
    "far_magnet": HiddenLaw("push", lambda t, q, v, xp: 0.01 / (0.3 - q) ** 2, 2.0, "q"),
    "bump": HiddenLaw(
        "push", lambda t, q, v, xp: (q + 0.2) / 0.03 * _bell((q + 0.2) / 0.03, xp), 3.0, "q"
    ),
    "sticky_place": HiddenLaw("push", lambda t, q, v, xp: -_bell((q + 0.15) / 0.05, xp), 2.0, "q"),
    "honey": HiddenLaw(
        "drag", lambda t, q, v, xp: abs(v) ** 1.5 * _bell((q + 0.15) / 0.08, xp), 3.0, "qv"
    ),
    "thinning_oil": HiddenLaw("drag", lambda t, q, v, xp: abs(v) * xp.exp(-t / 0.3), 2.0, "tv"),
    "slippery_when_fast": HiddenLaw(
        "friction", lambda t, q, v, xp: xp.exp(-abs(v) / 0.3), 1.5, "v"
    ),
    "one_way_brush": HiddenLaw("friction", lambda t, q, v, xp: v > 0, 0.8, "v"),
}
"""The last, friction in one direction only, does not show where nothing turns back."""


def _register(law_name: str, law: HiddenLaw) -> None:
    class Hidden(Effect):
        __doc__ = f"The law {law_name}."
        name: ClassVar[str] = f"hidden_{law_name}"

        def parameters(self, scene: Surroundings) -> tuple[Parameter, ...]:
            """The strength, over its size."""
            return (Parameter(self.name, "1", LogNormal(1.0, 0.25), 0.0, "effect"),)

        def _value(self, theta: Theta, state: State) -> Array:
            strength = theta[self.name][..., None]
            xp = strength.__array_namespace__()
            t = state.time_s + 0.0 * state.path_m
            return law.size * strength * law.formula(t, state.path_m, state.speed_m_s, xp)

        def force(self, theta: Theta, scene: Surroundings) -> Force | None:
            """The mass times the acceleration."""
            if law.kind == "friction":
                return None

            def act(state: State) -> Array:
                xp = state.path_m.__array_namespace__()
                mass = xp.stack(scene.mass(theta), axis=-1)
                if law.kind == "push":
                    first = xp.asarray([float(i == 0) for i in range(len(scene.names))])
                    return first * mass * self._value(theta, state)
                return -mass * xp.sign(state.speed_m_s) * self._value(theta, state)

            return act

        def friction(self, theta: Theta, scene: Surroundings) -> Friction | None:
            """The coefficients, 0 or more."""
            if law.kind != "friction":
                return None

            def changed(state: State, k: Array) -> Array:
                xp = k.__array_namespace__()
                return xp.maximum(k * (1.0 + self._value(theta, state)), 0.0 * k)

            return changed

    register(Hidden)


for _name, _law in LAWS.items():
    _register(_name, _law)
