"""Effects and laws that neither the library nor its forms without a name have, made by hand.

    galileo simulate --effects-from benchmarks/exotic_effects.py --effect exotic_gust ...

Of `exotic_NAME`, a diagnosis should say `unknown`, or `ambiguous`. Ripple, gust and heating have
the shape of one of the forms (`effects/forms`); the others were written after these, and have not.
A sticky spot is not among them: any short stretch that brakes is a `friction_patch`, and naming it
so is right. `hidden_NAME` are the laws that `laws` and `discover` are to find.

All are one formula of the time t, the place q along the path and the speed v of an object.
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
from galileo_jax.model.parameters import LogNormal, Normal, Parameter, Prior, Uniform

Kind = Literal["force", "push", "drag", "friction"]
"""N on object 1; m/s^2 of object 1; m/s^2 against the motion of all; k of all times 1 + f."""
Formula = Callable[..., Any]
"""Of t, q, v, the array module, and the parameters."""


def hide(effect: str, kind: Kind, formula: Formula, *unknowns: Parameter) -> None:
    """Registers an effect; the first parameter is its strength."""

    class Exotic(Effect):
        __doc__ = f"The {kind} {effect}."
        name: ClassVar[str] = effect

        def parameters(self, scene: Surroundings) -> tuple[Parameter, ...]:
            """The strength, then what places or shapes it."""
            return unknowns

        def _value(self, theta: Theta, state: State) -> Array:
            place, xp = state.path_m, state.path_m.__array_namespace__()
            time = state.time_s + 0.0 * place
            values = [theta[one.name][..., None] for one in unknowns]
            return formula(time, place, state.speed_m_s, xp, *values)

        def force(self, theta: Theta, scene: Surroundings) -> Force | None:
            """What acts on the objects, N."""
            if kind == "friction":
                return None

            def act(state: State) -> Array:
                xp = state.path_m.__array_namespace__()
                mass, value = xp.stack(scene.mass(theta), axis=-1), self._value(theta, state)
                if kind == "drag":
                    return -mass * xp.sign(state.speed_m_s) * value
                first = xp.asarray([float(i == 0) for i in range(len(scene.names))])
                return first * value * (mass if kind == "push" else 1.0)

            return act

        def friction(self, theta: Theta, scene: Surroundings) -> Friction | None:
            """The coefficients, 0 or more."""
            if kind != "friction":
                return None

            def changed(state: State, k: Array) -> Array:
                xp = k.__array_namespace__()
                return xp.maximum(k * (1.0 + self._value(theta, state)), 0.0 * k)

            return changed

    register(Exotic)


def exotic(name: str, kind: Kind, formula: Formula, unit: str, prior: Prior, *more: Any) -> None:
    """Registers `exotic_NAME`; `more`: name, unit and prior of another parameter."""
    unknowns = [Parameter(f"exotic_{name}", unit, prior, 0.0, "effect")]
    if more:
        called, its_unit, its_prior, usual = more
        unknowns.append(Parameter(f"exotic_{name}_{called}", its_unit, its_prior, usual, "effect"))
    hide(f"exotic_{name}", kind, formula, *unknowns)


def _bell(u: Any, xp: Any) -> Any:
    return xp.exp(-(u**2))


def _slope(t: Any, q: Any, v: Any, xp: Any, height: Any, place: Any) -> Any:
    """The push of a bump, g dh/dq with h = height exp(-((q - place) / 0.03 m)^2)."""
    u = (q - place) / 0.03
    return 9.81 * height * 2 * u / 0.03 * _bell(u, xp)


exotic("ripple", "friction", lambda t, q, v, xp, d, w: d * xp.sin(2 * xp.pi * q / w),
       "1", LogNormal(0.8, 0.15), "length", "m", LogNormal(0.25, 0.15), 0.25)  # fmt: skip
exotic("gust", "force", lambda t, q, v, xp, f, t0: f * _bell((t - t0) / 0.06, xp),
       "N", LogNormal(1.0, 0.4), "time", "s", Uniform(0.25, 0.55), 0.4)  # fmt: skip
exotic("bump", "push", _slope,
       "m", LogNormal(0.012, 0.2), "place", "m", Uniform(-0.25, -0.12), -0.2)  # fmt: skip
exotic("heating", "friction", lambda t, q, v, xp, rate: rate * t, "1/s", Normal(1.0, 0.5))
exotic("drying", "friction", lambda t, q, v, xp, d, t1: d * (1 + xp.tanh((t - t1) / 0.05)) / 2,
       "1", LogNormal(0.5, 0.3), "time", "s", Uniform(0.3, 0.5), 0.4)  # fmt: skip
exotic("dying_wind", "force", lambda t, q, v, xp, f: f * xp.exp(-t / 0.3),
       "N", LogNormal(0.4, 0.4))  # fmt: skip
exotic("root_drag", "drag", lambda t, q, v, xp, c: c * abs(v) / xp.sqrt(abs(v) + 1e-9),
       "m^0.5 s^-1.5", LogNormal(0.6, 0.4))  # fmt: skip
exotic("growing_force", "force", lambda t, q, v, xp, f: f * xp.sqrt(abs(t) + 1e-9),
       "N", LogNormal(0.4, 0.4))  # fmt: skip
exotic("magnet", "force",
       lambda t, q, v, xp, f, at: -f * (q - at) / 0.04 / (1 + ((q - at) / 0.04) ** 2) ** 2,
       "N", LogNormal(2.0, 0.3), "place", "m", Uniform(-0.2, 0.1), -0.05)  # fmt: skip


class HiddenLaw(NamedTuple):
    """A law and what counts as having found it."""

    kind: Kind  # push, drag or friction
    formula: Formula  # for a strength of one; of t, q, v and the array module
    size: float  # of the strength, median
    variables: str  # that it depends on
    power: float | None = None  # of the only variable; None where it is no power


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

for _name, _law in LAWS.items():
    hide(
        f"hidden_{_name}",
        _law.kind,
        lambda t, q, v, xp, strength, law=_law: law.size * strength * law.formula(t, q, v, xp),
        Parameter(f"hidden_{_name}", "1", LogNormal(1.0, 0.25), 0.0, "effect"),
    )
