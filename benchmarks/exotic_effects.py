"""Effects that the library does not have: a diagnosis should say `unknown`, or `ambiguous`.

    galileo simulate --effects-from benchmarks/exotic_effects.py --effect exotic_gust ...

Ripple, gust and heating have the shape of one of the forms without a name (`effects/forms`); bump,
drying, dying wind, growing force, magnet and root drag were written after these, and have not.

A sticky spot is not among them: any short stretch that brakes is a `friction_patch`, and
naming it so is right.
"""

import math
from collections.abc import Callable
from typing import ClassVar, Literal

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

Hook = Callable[[Theta, Surroundings], Force | Friction]


def unknown(name: str, unit: str, prior: Prior, usual: float = 0.0) -> Parameter:
    """A parameter of an effect; `usual` is where it is while nothing is there."""
    return Parameter(f"exotic_{name}", unit, prior, usual, "effect")


def exotic(kind: Literal["force", "friction"], *unknowns: Parameter) -> Callable[[Hook], Hook]:
    """Registers an effect by its one hook; it is called as the first of its parameters."""

    def registered(hook: Hook) -> Hook:
        class Exotic(Effect):
            __doc__ = hook.__doc__
            name: ClassVar[str] = unknowns[0].name

            def parameters(self, scene: Surroundings) -> tuple[Parameter, ...]:
                """The strength, then what places or shapes it."""
                return unknowns

        setattr(Exotic, kind, lambda self, theta, scene: hook(theta, scene))
        register(Exotic)
        return hook

    return registered


@exotic(
    "friction",
    unknown("ripple", "1", LogNormal(0.8, 0.15)),
    unknown("ripple_length", "m", LogNormal(0.25, 0.15), 0.25),
)
def ripple(theta: Theta, scene: Surroundings) -> Friction:
    """Friction that waves along the path: k (1 + d sin(2 pi q / w)), for all objects."""
    depth, length = theta["exotic_ripple"], theta["exotic_ripple_length"]

    def law(state: State, k: Array) -> Array:
        wave = k.__array_namespace__().sin(2 * math.pi * state.path_m / length)
        return k * (1.0 + depth * wave)

    return law


@exotic(
    "force",
    unknown("gust", "N", LogNormal(1.0, 0.4)),
    unknown("gust_time", "s", Uniform(0.25, 0.55), 0.4),
)
def gust(theta: Theta, scene: Surroundings) -> Force:
    """A gust: a pulse of force on object 1, F exp(-((t - t0) / w)^2), w = 0.06 s."""
    size = scene.only(theta["exotic_gust"], 0)

    def pulse(state: State) -> Array:
        apart = (state.time_s - theta["exotic_gust_time"]) / 0.06
        return size * size.__array_namespace__().exp(-(apart**2))

    return pulse


@exotic(
    "force",
    unknown("bump", "m", LogNormal(0.012, 0.2)),
    unknown("bump_place", "m", Uniform(-0.25, -0.12), -0.2),
)
def bump(theta: Theta, scene: Surroundings) -> Force:
    """A bump in the way of object 1: it is slowed down going up and sped up coming down.

    F = -m g dh/dq, h = height exp(-((q - place) / 0.03 m)^2)
    """
    weight = scene.only(theta["exotic_bump"] * theta["m1"] * scene.gravity, 0)

    def slope(state: State) -> Array:
        away = (state.path_m - theta["exotic_bump_place"]) / 0.03
        return weight * 2 * away / 0.03 * weight.__array_namespace__().exp(-(away**2))

    return slope


@exotic("friction", unknown("heating", "1/s", Normal(1.0, 0.5)))
def heating(theta: Theta, scene: Surroundings) -> Friction:
    """Friction that grows with time as surfaces warm up: k (1 + t / tau), for all objects."""

    def law(state: State, k: Array) -> Array:
        return k * (1.0 + theta["exotic_heating"] * state.time_s)

    return law


@exotic(
    "friction",
    unknown("drying", "1", LogNormal(0.5, 0.3)),
    unknown("drying_time", "s", Uniform(0.3, 0.5), 0.4),
)
def drying(theta: Theta, scene: Surroundings) -> Friction:
    """Friction that jumps at one moment: k (1 + d) after t1, within 0.05 s, for all objects."""

    def law(state: State, k: Array) -> Array:
        late = (state.time_s - theta["exotic_drying_time"]) / 0.05
        share = 0.5 * (1.0 + k.__array_namespace__().tanh(late))
        return k * (1.0 + theta["exotic_drying"] * share)

    return law


@exotic("force", unknown("dying_wind", "N", LogNormal(0.4, 0.4)))
def dying_wind(theta: Theta, scene: Surroundings) -> Force:
    """Wind along the path that dies down: F exp(-t / 0.3 s) on object 1."""
    size = scene.only(theta["exotic_dying_wind"], 0)

    def wind(state: State) -> Array:
        time = state.time_s + 0.0 * size
        return size * size.__array_namespace__().exp(-time / 0.3)

    return wind


@exotic("force", unknown("root_drag", "m^0.5 s^-1.5", LogNormal(0.6, 0.4)))
def root_drag(theta: Theta, scene: Surroundings) -> Force:
    """Drag that grows with the root of the speed, on all objects: F = -c m sqrt(|v|) sign(v)."""

    def drag(state: State) -> Array:
        speed = state.speed_m_s
        xp = speed.__array_namespace__()
        mass = xp.stack(scene.mass(theta), axis=-1)
        root = xp.sqrt(abs(speed) + 1e-9)
        return -theta["exotic_root_drag"][..., None] * mass * speed / root

    return drag


@exotic("force", unknown("growing_force", "N", LogNormal(0.4, 0.4)))
def growing_force(theta: Theta, scene: Surroundings) -> Force:
    """A force on object 1 that grows as the root of the time: F = F0 sqrt(t / 1 s)."""
    size = scene.only(theta["exotic_growing_force"], 0)

    def growing(state: State) -> Array:
        time = state.time_s + 0.0 * size
        return size * size.__array_namespace__().sqrt(abs(time) + 1e-9)

    return growing


@exotic(
    "force",
    unknown("magnet", "N", LogNormal(2.0, 0.3)),
    unknown("magnet_place", "m", Uniform(-0.2, 0.1), -0.05),
)
def magnet(theta: Theta, scene: Surroundings) -> Force:
    """A magnet beside the way attracts object 1: F = -F0 u / (1 + u^2)^2, u = (q - place) / 4 cm.

    It pulls forward before the place and back behind it.
    """
    size = scene.only(theta["exotic_magnet"], 0)

    def pull(state: State) -> Array:
        away = (state.path_m - theta["exotic_magnet_place"][..., None]) / 0.04
        return -size * away / (1.0 + away**2) ** 2

    return pull
