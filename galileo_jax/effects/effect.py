"""What an effect is: parameters and the few places where it may touch the model.

An effect is written once, in terms of the array standard (`x.__array_namespace__()`), and
runs inside both engines: NumPy in the C engine, JAX in MJX. Every hook's default does
nothing; an effect overrides those it needs. At its parameters' `absent` values each hook
must return exactly what the default returns.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, ClassVar, NamedTuple

from galileo_jax.parameters import Parameter

# NumPy or JAX arrays alike; shapes are said in the docstrings.
Array = Any
Theta = Mapping[str, Array]


class State(NamedTuple):
    """The objects at one instant; leading axes are the batch's.

    Attributes:
      position_m: `[..., object, 2]`, centres; x along the travel, y up.
      velocity_m_s: `[..., object, 2]`.
      time_s: scalar, since the release.
    """

    position_m: Array
    velocity_m_s: Array
    time_s: Array


Force = Callable[[State], Array]


@dataclass(frozen=True)
class Surroundings:
    """What an effect may know of the scene.

    Attributes:
      names: of the objects.
      angle_rad: the ramp's; 0 without a ramp.
      gravity: m/s^2.
      half_length_m, half_height_m: `[object]`, along the travel and across it.
      corner_m: `[object]`, x at which each centre's path bends from ramp to table.
      start_m: `[object, 2]`, the centres at the release.
      release_s: when the release was, after the first frame: expected, and its standard
        deviation.
      is_scale_known: whether the observation's metres are metres (`pixels_per_metre` given).
    """

    names: tuple[str, ...]
    angle_rad: float
    gravity: float
    half_length_m: tuple[float, ...]
    half_height_m: tuple[float, ...]
    corner_m: tuple[float, ...]
    start_m: tuple[tuple[float, float], ...]
    release_s: tuple[float, float] = (0.0, 0.01)
    is_scale_known: bool = True

    def mass(self, theta: Theta) -> list[Array]:
        """The objects' masses, kg, each `[...]`."""
        return [theta[f"m{i + 1}"] for i in range(len(self.names))]


class Effect:
    """One physical (or measurement) effect; subclasses are stateless."""

    name: ClassVar[str]

    def parameters(self, scene: Surroundings) -> tuple[Parameter, ...]:
        """The unknowns it brings, the strength first; empty where it has no place."""
        raise NotImplementedError

    def start(self, position_m: Array, theta: Theta, scene: Surroundings) -> Array:
        """Moves the centres at the release: `[..., object, 2]`, m, to the same shape."""
        return position_m

    def force(self, theta: Theta, scene: Surroundings) -> Force | None:
        """Returns the force as a function of the state, or None.

        What depends on the parameters alone is computed here, once per rollout; the function
        returned maps a `State` to `[..., object, 2]`, N, and is called every recorded step.
        """
        return None

    def restitution(self, theta: Theta, scene: Surroundings) -> Array | None:
        """Returns the coefficient of restitution between objects `[...]`, or None."""
        return None

    def time(self, time_s: Array, theta: Theta, scene: Surroundings) -> Array:
        """Maps the clip's time to the time since the release, s: `[frame]` to `[frame]`."""
        return time_s

    def measure(self, position_m: Array, theta: Theta, scene: Surroundings) -> Array:
        """Maps true centres to measured ones, `[object, 2, frame]`, m (scale, camera)."""
        return position_m
