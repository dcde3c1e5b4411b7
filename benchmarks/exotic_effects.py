"""Effects that the library does not have: a diagnosis should say `unknown`, or `ambiguous`.

    galileo simulate --effects-from benchmarks/exotic_effects.py --effect exotic_gust ...

Ripple, gust and heating have the shape of one of the forms without a name (`effects/forms`); bump,
drying, dying wind, growing force, magnet and root drag were written after these, and have not.

A sticky spot is not among them: any short stretch that brakes is a `friction_patch`, and
naming it so is right.
"""

import math
from typing import ClassVar

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


def unknown(name: str, unit: str, prior: Prior, usual: float = 0.0) -> Parameter:
    """A parameter of an effect; `usual` is where it is while nothing is there."""
    return Parameter(name, unit, prior, usual, "effect")


@register
class Ripple(Effect):
    """Friction that waves along the path: k (1 + d sin(2 pi q / w)), for all objects."""

    name: ClassVar[str] = "exotic_ripple"

    def parameters(self, scene: Surroundings) -> tuple[Parameter, ...]:
        """Depth d and wavelength w."""
        return (
            unknown("exotic_ripple", "1", LogNormal(0.8, 0.15)),
            unknown("exotic_ripple_length", "m", LogNormal(0.25, 0.15), 0.25),
        )

    def friction(self, theta: Theta, scene: Surroundings) -> Friction:
        """The coefficients at the places."""
        depth, length = theta["exotic_ripple"], theta["exotic_ripple_length"]

        def law(state: State, k: Array) -> Array:
            wave = k.__array_namespace__().sin(2 * math.pi * state.path_m / length)
            return k * (1.0 + depth * wave)

        return law


@register
class Gust(Effect):
    """A gust: a pulse of force on object 1, F exp(-((t - t0) / w)^2), w = 0.06 s."""

    name: ClassVar[str] = "exotic_gust"

    def parameters(self, scene: Surroundings) -> tuple[Parameter, ...]:
        """Force and time."""
        return (
            unknown("exotic_gust", "N", LogNormal(1.0, 0.4)),
            unknown("exotic_gust_time", "s", Uniform(0.25, 0.55), 0.4),
        )

    def force(self, theta: Theta, scene: Surroundings) -> Force:
        """The force at the time."""
        size = scene.only(theta["exotic_gust"], 0)

        def pulse(state: State):
            apart = (state.time_s - theta["exotic_gust_time"]) / 0.06
            return size * size.__array_namespace__().exp(-(apart**2))

        return pulse


@register
class Bump(Effect):
    """A bump in the way of object 1: it is slowed down going up and sped up coming down.

    F = -m g dh/dq, h = height exp(-((q - place) / 0.03 m)^2)
    """

    name: ClassVar[str] = "exotic_bump"

    def parameters(self, scene: Surroundings) -> tuple[Parameter, ...]:
        """Height and place."""
        return (
            unknown("exotic_bump", "m", LogNormal(0.012, 0.2)),
            unknown("exotic_bump_place", "m", Uniform(-0.25, -0.12), -0.2),
        )

    def force(self, theta: Theta, scene: Surroundings) -> Force:
        """The force at the place."""
        weight = scene.only(theta["exotic_bump"] * theta["m1"] * scene.gravity, 0)

        def slope(state: State):
            away = (state.path_m - theta["exotic_bump_place"]) / 0.03
            return weight * 2 * away / 0.03 * weight.__array_namespace__().exp(-(away**2))

        return slope


@register
class Heating(Effect):
    """Friction that grows with time as surfaces warm up: k (1 + t / tau), for all objects."""

    name: ClassVar[str] = "exotic_heating"

    def parameters(self, scene: Surroundings) -> tuple[Parameter, ...]:
        """The rate 1 / tau."""
        return (unknown("exotic_heating", "1/s", Normal(1.0, 0.5)),)

    def friction(self, theta: Theta, scene: Surroundings) -> Friction:
        """The coefficients at the time."""

        def law(state: State, k: Array) -> Array:
            return k * (1.0 + theta["exotic_heating"] * state.time_s)

        return law


@register
class Drying(Effect):
    """Friction that jumps at one moment: k (1 + d) after t1, within 0.05 s, for all objects."""

    name: ClassVar[str] = "exotic_drying"

    def parameters(self, scene: Surroundings) -> tuple[Parameter, ...]:
        """Share d and time t1."""
        return (
            unknown("exotic_drying", "1", LogNormal(0.5, 0.3)),
            unknown("exotic_drying_time", "s", Uniform(0.3, 0.5), 0.4),
        )

    def friction(self, theta: Theta, scene: Surroundings) -> Friction:
        """The coefficients at the time."""

        def law(state: State, k: Array) -> Array:
            late = (state.time_s - theta["exotic_drying_time"]) / 0.05
            share = 0.5 * (1.0 + k.__array_namespace__().tanh(late))
            return k * (1.0 + theta["exotic_drying"] * share)

        return law


@register
class DyingWind(Effect):
    """Wind along the path that dies down: F exp(-t / 0.3 s) on object 1."""

    name: ClassVar[str] = "exotic_dying_wind"

    def parameters(self, scene: Surroundings) -> tuple[Parameter, ...]:
        """Force at the release."""
        return (unknown("exotic_dying_wind", "N", LogNormal(0.4, 0.4)),)

    def force(self, theta: Theta, scene: Surroundings) -> Force:
        """The force at the time."""
        size = scene.only(theta["exotic_dying_wind"], 0)

        def wind(state: State) -> Array:
            time = state.time_s + 0.0 * size
            return size * size.__array_namespace__().exp(-time / 0.3)

        return wind


@register
class RootDrag(Effect):
    """Drag that grows with the root of the speed, on all objects: F = -c m sqrt(|v|) sign(v)."""

    name: ClassVar[str] = "exotic_root_drag"

    def parameters(self, scene: Surroundings) -> tuple[Parameter, ...]:
        """Coefficient c, m^0.5 s^-1.5."""
        return (unknown("exotic_root_drag", "m^0.5 s^-1.5", LogNormal(0.6, 0.4)),)

    def force(self, theta: Theta, scene: Surroundings) -> Force:
        """The force at the speeds."""

        def drag(state: State) -> Array:
            speed = state.speed_m_s
            xp = speed.__array_namespace__()
            mass = xp.stack(scene.mass(theta), axis=-1)
            root = xp.sqrt(abs(speed) + 1e-9)
            return -theta["exotic_root_drag"][..., None] * mass * speed / root

        return drag


@register
class GrowingForce(Effect):
    """A force on object 1 that grows as the root of the time: F = F0 sqrt(t / 1 s)."""

    name: ClassVar[str] = "exotic_growing_force"

    def parameters(self, scene: Surroundings) -> tuple[Parameter, ...]:
        """Force after a second."""
        return (unknown("exotic_growing_force", "N", LogNormal(0.4, 0.4)),)

    def force(self, theta: Theta, scene: Surroundings) -> Force:
        """The force at the time."""
        size = scene.only(theta["exotic_growing_force"], 0)

        def growing(state: State) -> Array:
            time = state.time_s + 0.0 * size
            return size * size.__array_namespace__().sqrt(abs(time) + 1e-9)

        return growing


@register
class Magnet(Effect):
    """A magnet beside the way attracts object 1: F = -F0 u / (1 + u^2)^2, u = (q - place) / 4 cm.

    It pulls forward before the place and back behind it.
    """

    name: ClassVar[str] = "exotic_magnet"

    def parameters(self, scene: Surroundings) -> tuple[Parameter, ...]:
        """Force and place."""
        return (
            unknown("exotic_magnet", "N", LogNormal(2.0, 0.3)),
            unknown("exotic_magnet_place", "m", Uniform(-0.2, 0.1), -0.05),
        )

    def force(self, theta: Theta, scene: Surroundings) -> Force:
        """The force at the place."""
        size = scene.only(theta["exotic_magnet"], 0)

        def pull(state: State) -> Array:
            away = (state.path_m - theta["exotic_magnet_place"][..., None]) / 0.04
            return -size * away / (1.0 + away**2) ** 2

        return pull
