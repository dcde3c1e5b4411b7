"""Effects of every kind a hook allows, for tests of the engines; not the package's own."""

from typing import ClassVar

from galileo_jax.model.effects.effect import Array, Effect, Force, Friction, Surroundings, Theta
from galileo_jax.model.parameters import Normal, Parameter


class Strength(Effect):
    """One parameter, named as the effect, absent at 0."""

    def parameters(self, scene: Surroundings) -> tuple[Parameter, ...]:
        return (Parameter(self.name, "1", Normal(0.0, 1.0), 0.0, "effect"),)


class Drag(Strength):
    """A force against the speed, of size c v + c v^2 (N, kg/s, kg/m)."""

    name: ClassVar[str] = "drag"

    def force(self, theta: Theta, scene: Surroundings) -> Force | None:
        strength = theta["drag"][..., None]
        return lambda state: -strength * state.speed_m_s * (1 + abs(state.speed_m_s))


class Spring(Strength):
    """Pulls object 1 back towards the foot, N/m."""

    name: ClassVar[str] = "spring"

    def force(self, theta: Theta, scene: Surroundings) -> Force | None:
        strength = scene.only(theta["spring"], 0)
        return lambda state: -strength * state.path_m


class Wind(Strength):
    """Pushes object 1 back up, N."""

    name: ClassVar[str] = "wind"

    def force(self, theta: Theta, scene: Surroundings) -> Force | None:
        strength = scene.only(theta["wind"], 0)
        return lambda state: -strength + 0.0 * state.path_m


class Swaying(Strength):
    """A push on every object that comes and goes with the time, N."""

    name: ClassVar[str] = "swaying"

    def force(self, theta: Theta, scene: Surroundings) -> Force | None:
        xp = theta["swaying"].__array_namespace__()
        strength = theta["swaying"][..., None]
        return lambda state: strength * xp.sin(3.0 * state.time_s) + 0.0 * state.path_m


class Stribeck(Strength):
    """More friction at low speed."""

    name: ClassVar[str] = "stribeck"

    def friction(self, theta: Theta, scene: Surroundings) -> Friction | None:
        xp = theta["stribeck"].__array_namespace__()
        strength = theta["stribeck"][..., None]
        return lambda state, k: k * (1 + strength * xp.exp(-(state.speed_m_s**2)))


class Turning(Strength):
    """Something that turns inside object 1: inertia, as a share of its mass."""

    name: ClassVar[str] = "turning"

    def inertia(self, theta: Theta, scene: Surroundings) -> Array | None:
        return scene.only(theta["turning"], 0)


class Tilt(Strength):
    """Ramp and table steeper than declared, rad."""

    name: ClassVar[str] = "tilt"

    def tilt(self, theta: Theta, scene: Surroundings) -> tuple[Array, Array] | None:
        return theta["tilt"], theta["tilt"]


class Push(Strength):
    """The speed of object 1 at the release, m/s."""

    name: ClassVar[str] = "push"

    def start_speed(self, theta: Theta, scene: Surroundings) -> Array | None:
        return scene.only(theta["push"], 0)


EVERY_KIND = (Drag(), Spring(), Wind(), Swaying(), Stribeck(), Turning(), Tilt(), Push())
