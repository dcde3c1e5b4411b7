"""What an effect is: parameters and the few places where it may touch the model.

An effect is written once, in terms of the array standard (`x.__array_namespace__()`), and
runs in every engine, NumPy or JAX. Every hook's default does nothing; an effect overrides
those it needs. At its parameters' `absent` values each hook must return exactly what the
default returns, and have a finite derivative.

Objects move along a path: down the ramp and along the table, straight down, or freely through
the plane of the picture. Hooks see and return numbers along it, positive downhill and away from
the ramp; in the plane, along the velocity.
"""

import functools
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, fields, replace
from typing import Any, ClassVar, NamedTuple

import jax
import numpy as np
from jaxtyping import Float

from galileo_jax.model.parameters import Parameter

# NumPy or JAX arrays alike; the leading axes are the batch's.
AnyArray = np.ndarray | jax.Array
Array = Float[AnyArray, "..."]
PerObject = Float[AnyArray, "... object"]
Theta = Mapping[str, Any]
"""Parameters by name, each `[...]` (a number, or one for each of a batch)."""


class State(NamedTuple):
    """The objects at one instant; leading axes are the batch's."""

    # How far each centre is past the foot; negative on the ramp. Without a table: how far it has
    # gone; in the plane, along its curve
    path_m: PerObject
    speed_m_s: PerObject  # to a friction law, that at which the surfaces slip
    time_s: Float[AnyArray, ""]  # since the release
    is_on_ramp: PerObject


class Bounce(NamedTuple):
    """A level floor; each `[...]`."""

    height_m: Array  # of an object's centre when it touches the floor, y as measured
    restitution: Array  # share of the speed against the floor with which it leaves
    grip: Array  # share of the speed along the floor that is lost


class Rims(NamedTuple):
    """What happens where the rims of discs meet."""

    restitution: Array  # `[...]`, of the speed along the centres
    grip: Array  # `[...]`, the most that the impulse across them is, as a share of that along them
    offset_m: Float[AnyArray, "... object 2"]  # where each disc is beside where it was seen


class Walls(NamedTuple):
    """Straight walls off which discs bounce that are seen from above."""

    ends_m: Float[AnyArray, "... wall end 2"]  # the lines that rims touch, as measured
    restitution: Array  # `[...]`, of the speed against a wall
    grip: Array  # `[...]`, the most that the impulse along a wall is, as a share of that against it


# In `Surroundings.expected`: of a high fall; how well the angle and the origin are known.
FALL_LENGTH, ANGLE, ORIGIN = "fall_length", "declared_angle", "origin_m"
PENDULUM = "pendulum"  # the law under which the path is a circle
SPRING = "spring"  # the law of what swings along a line
SPIN = "spin"  # its components by axis, "spin_x" and so on, where the spin is known

Force = Callable[[State], PerObject]
Push = Callable[[Float[AnyArray, " axis"], Float[AnyArray, ""]], Float[AnyArray, " axis"]]
Friction = Callable[[State, PerObject], PerObject]

_STATIC = (
    *("names", "has_table", "comes_down", "is_scale_known", "is_scale_stated"),
    *("has_surface", "rolls", "moves_in_plane", "laws"),
)


@jax.tree_util.register_pytree_with_keys_class
@dataclass(frozen=True)
class Surroundings:
    """What an effect may know of the scene.

    A PyTree, so that one compiled program serves every clip: inside it the numbers are
    traced. What decides which parameters there are is static.
    """

    names: tuple[str, ...]  # of the objects
    angle_rad: float  # the ramp's; of a path straight down pi / 2, in the plane 0
    # m/s^2, as declared; to the hooks of the motion, within compiled code, `[...]`
    gravity: Any
    # `[object]`, along the travel and across it
    half_length_m: tuple[float, ...]
    half_height_m: tuple[float, ...]
    # `[object]`, x at which each centre's path bends from ramp to table; inf without a table
    corner_m: tuple[float, ...]
    # `[object, axis]`, the centres at the release; of a flight in space with z
    start_m: tuple[tuple[float, ...], ...]
    start_path_m: tuple[float, ...]  # `[object]`, the same along the path, see `State`
    has_table: bool  # whether the ramp ends on a table
    comes_down: tuple[bool, ...]  # `[object]`, whether the object starts on the ramp
    # When the release was, after the first frame: expected, and its standard deviation
    release_s: tuple[float, float] = (0.0, 0.01)
    is_scale_known: bool = True  # whether the observation's metres are metres
    is_scale_stated: bool = False  # whether the clip says how well its scale is known
    # Whether objects slide on something; not in a fall, in the air, in a liquid
    has_surface: bool = True
    mass_kg: tuple[float | None, ...] = ()  # `[object]`, as weighed, None where not; empty: none is
    # `[object]`, whether it is round and may turn, and beta = J / (m r^2) then; empty: none does
    rolls: tuple[bool, ...] = ()
    roll_inertia: tuple[float, ...] = ()
    is_box: tuple[bool, ...] = ()  # `[object]`, whether it is declared to be one; empty: none is
    moves_in_plane: bool = False  # whether the path is not given, but bends with the motion
    laws: tuple[str, ...] = ()  # names of those that are always there (`effects/laws/`)
    # By name the two numbers of a prior: of the laws' parameters what a look at the clip suggests,
    # wide against what the fit will tell; of the angle, scale and origin how well they are
    # declared, where not taken at their word
    expected: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    # `[wall, end, 2]`, on a table that is seen from above: the declared walls' ends
    walls_m: tuple[tuple[tuple[float, float], tuple[float, float]], ...] = ()
    # `[object]`, of boxes that move freely: half the extent across the travel, and how far the
    # centre is from the plane, towards the camera; empty: of others
    half_depth_m: tuple[float, ...] = ()
    beside_m: tuple[float, ...] = ()
    way_m: float = 0.0  # how far object 1 is seen to go; 0: nothing was seen yet

    @property
    def is_level(self) -> bool:
        """Whether objects slide on a level table that is seen from above."""
        return self.has_surface and self.moves_in_plane

    @property
    def crosses_foot(self) -> bool:
        """Whether object 1 comes down a ramp onto a table."""
        return self.has_table and self.comes_down[0]

    @property
    def starts_moving(self) -> bool:
        """Whether nothing is let go: the object moves when it is first seen."""
        return "start_velocity" in self.laws or self.is_level

    @property
    def is_thrown(self) -> bool:
        """Whether the start's velocity may have any direction; on a thread it has the circle's."""
        return self.moves_in_plane and PENDULUM not in self.laws

    @property
    def num_axes(self) -> int:
        """2, or 3 of what was measured in space: x, y (up), z; from above x, y, turning (rad)."""
        return len(self.start_m[0])

    @property
    def angle_sd_rad(self) -> float:
        """How well the ramp's angle (in the plane: gravity's direction) is known; 0: exactly."""
        return self.expected.get(ANGLE, (0.0, 0.0))[1]

    def tree_flatten_with_keys(self):
        """Splits into traced numbers and static facts."""
        leaves = [(jax.tree_util.GetAttrKey(key), getattr(self, key)) for key in _ARRAYS]
        return leaves, tuple(getattr(self, key) for key in _STATIC)

    @classmethod
    def tree_unflatten(cls, facts, leaves):
        """The inverse; past the constructor, for JAX puts anything in the place of a number."""
        made = object.__new__(cls)
        for key, value in zip((*_ARRAYS, *_STATIC), (*leaves, *facts), strict=True):
            object.__setattr__(made, key, value)
        return made

    def mass(self, theta: Theta) -> list[Array]:
        """The objects' masses, kg, each `[...]`."""
        return [theta[f"m{i + 1}"] for i in range(len(self.names))]

    def weight(self, theta: Theta) -> PerObject:
        """The objects' weights, N, `[..., object]`."""
        mass = self.mass(theta)
        xp = mass[0].__array_namespace__()
        return xp.stack(mass, axis=-1) * xp.asarray(self.gravity)[..., None]

    def numbered(self, *names: str) -> list[list[str]]:
        """The parameters that each object has of its own, NAME1 and so on: `[object][name]`."""
        return [[f"{name}{i + 1}" for name in names] for i in range(len(self.names))]

    def only(self, value: Any, *objects: int) -> Array:
        """`value` `[...]` for the given objects (counted from 0), 0 for others: `[..., object]`."""
        chosen = [1.0 if i in objects else 0.0 for i in range(len(self.names))]
        return value[..., None] * value.__array_namespace__().asarray(chosen)


Place = Callable[[Surroundings], bool]


_ARRAYS = tuple(one.name for one in fields(Surroundings) if one.name not in _STATIC)


class Effect:
    """One physical (or measurement) effect.

    Compiled programs are found by their effects: two are the same if they are of one class and have
    the same attributes (of the package's own few have any).

    `theta` maps parameters' names to arrays `[...]`; numbers of objects are `[..., object]`.
    """

    name: ClassVar[str]
    unknowns: ClassVar[tuple[Parameter, ...]] = ()
    """Its `parameters`, where they are the same in every scene."""

    def __init_subclass__(cls, where: Place | None = None) -> None:
        """`where` tells in which scenes the effect has a place; in others its hooks do nothing."""
        super().__init_subclass__()
        if "unknowns" in vars(cls):
            cls.parameters = lambda self, scene: self.unknowns
        if where is None:
            return
        for hook in HOOKS:
            if (own := getattr(cls, hook)) is not (absent := getattr(Effect, hook)):
                setattr(cls, hook, _in_place(where, own, absent))

    def __eq__(self, other: object) -> bool:
        """Whether the other does the same, also to a compiled program."""
        return isinstance(other, Effect) and self.identity() == other.identity()

    def __hash__(self) -> int:
        """Of the class."""
        return hash(type(self))

    def identity(self) -> tuple[Any, ...]:
        """What its hooks depend on besides their arguments: the class, and all attributes.

        An effect whose attributes reach its hooks as parameters only may leave them out.
        """
        return type(self), vars(self)

    def parameters(self, scene: Surroundings) -> tuple[Parameter, ...]:
        """The unknowns it brings, the strength first; empty where it has no place."""
        return ()

    def odds(self, theta: Theta, scene: Surroundings) -> float:
        """How many times as likely as its prior says it is to be there, at these values.

        1 but where what is known of the clip leads to expect it, and of laws without a name.
        """
        return 1.0

    def start(self, path_m: PerObject, theta: Theta, scene: Surroundings) -> PerObject:
        """Moves the centres at the release along the path: `[..., object]` to the same."""
        return path_m

    def start_speed(self, theta: Theta, scene: Surroundings) -> PerObject | None:
        """Returns the speed at the release `[..., object]`, m/s, or None."""

    def start_velocity(
        self, theta: Theta, scene: Surroundings
    ) -> Float[AnyArray, "... object 2"] | None:
        """Returns the velocity in the plane at the start `[..., object, 2]`, m/s, or None.

        In space `[..., object, 3]`; from above the third is the turning, rad/s.
        """

    def force(self, theta: Theta, scene: Surroundings) -> Force | None:
        """Returns the force along the path as a function of the state, or None.

        What depends on the parameters alone is computed here, once per rollout; the function
        returned maps a `State` to `[..., object]`, N.
        """

    def push(self, theta: Theta, scene: Surroundings) -> Push | None:
        """Returns a force with a direction of its own, on what moves freely, or None.

        The function maps the velocity `[axis]`, m/s, of the one body of a flight, and the time
        since the start, s, to a force `[axis]`, N: x, y (up) and, of a track in space, z.
        """

    def friction(self, theta: Theta, scene: Surroundings) -> Friction | None:
        """Returns what friction coefficients become, or None.

        The function maps a `State` and coefficients `[..., object]` to coefficients.
        """

    def inertia(self, theta: Theta, scene: Surroundings) -> PerObject | None:
        """Returns the inertia on top of the mass, as a share of it `[..., object]`, or None."""

    def tilt(self, theta: Theta, scene: Surroundings) -> tuple[Array, Array] | None:
        """Returns how much steeper ramp and table are than declared, rad, each `[...]`, or None.

        In the plane: how far gravity points forward of the picture's vertical, and 0. From above:
        how much the table falls towards x, and towards y.
        """

    def gravity(self, theta: Theta, scene: Surroundings) -> Array | None:
        """Returns the acceleration of free fall `[...]`, m/s^2, or None: as declared."""

    def foot(self, theta: Theta, scene: Surroundings) -> Array | None:
        """Returns the factor on the speed kept at the foot `[...]`, or None."""

    def restitution(self, theta: Theta, scene: Surroundings) -> Array | None:
        """Returns the coefficient of restitution between objects `[...]`, or None."""

    def passed_on(self, theta: Theta, scene: Surroundings) -> tuple[Array, ...] | None:
        """Returns for each pair of neighbours the factor on the momentum in a hit, or None."""

    def overlap(self, theta: Theta, scene: Surroundings) -> Array | None:
        """Returns by how much less neighbours are apart at their first hit `[...]`, m, or None."""

    def stretch(self, theta: Theta, scene: Surroundings) -> Array | None:
        """Returns by how much its weight stretches a pendulum's thread `[...]`, m, or None."""

    def bounce(self, theta: Theta, scene: Surroundings) -> Bounce | None:
        """Returns the floor, or None where there is none to bounce on."""

    def rims(self, theta: Theta, scene: Surroundings) -> Rims | None:
        """Returns what hits of discs do that are seen from above, or None."""

    def pressure(self, theta: Theta, scene: Surroundings) -> Array | None:
        """Returns where discs that are seen from above press on the table, or None.

        Beside their middles, `[..., object, 2]`, as shares of their radii along x and y when they
        are first seen.
        """

    def oval(self, theta: Theta, scene: Surroundings) -> Array | None:
        """Returns how far from round the rims of discs are that are seen from above, or None.

        c and s of the second harmonic of how far they reach, as shares of their radii
        (`rollout/disc_hits.py`), when the discs are first seen: `[..., object, 2]`.
        """

    def walls(self, theta: Theta, scene: Surroundings) -> Walls | None:
        """Returns the walls off which discs bounce that are seen from above, or None."""

    def derived(self, theta: Theta, scene: Surroundings) -> Mapping[str, tuple[Array, str]]:
        """Returns what follows from the parameters and is worth telling: name to value and unit."""
        return {}

    def time(
        self, time_s: Float[AnyArray, "frame ..."], theta: Theta, scene: Surroundings
    ) -> Float[AnyArray, "frame ..."]:
        """Maps the clip's time to the time since the release, s, `[frame, ...]`."""
        return time_s

    def measure(
        self, position_m: Float[AnyArray, "object axis frame"], theta: Theta, scene: Surroundings
    ) -> Float[AnyArray, "object axis frame"]:
        """Maps true centres to measured ones, `[object, axis, frame]`, m (scale, camera)."""
        return position_m


HOOKS = {name for name in vars(Effect) if not name.startswith("_")} - {
    "identity",
    "name",
    "unknowns",
}


def _in_place(where: Place, own: Any, absent: Any) -> Any:
    """The hook `own` of an effect; `absent` in a scene, the last argument, without a place."""

    @functools.wraps(own)
    def hook(self: Effect, *arguments: Any) -> Any:
        return (own if where(arguments[-1]) else absent)(self, *arguments)

    return hook


def by_object(theta: Theta, names: Sequence[Sequence[str]]) -> Float[AnyArray, "... object part"]:
    """Parameters of each object by their names; 0 of those that there are not."""
    zero = 0.0 * theta["m1"]
    xp = zero.__array_namespace__()
    rows = [xp.stack([theta.get(name, zero) for name in own], axis=-1) for own in names]
    return xp.stack(rows, axis=-2)


def not_negative(k: PerObject) -> PerObject:
    """Friction coefficients, or 0 in place of what is less."""
    return k.__array_namespace__().maximum(k, 0.0 * k)


def true_surroundings(effects: Sequence[Effect], theta: Theta, scene: Surroundings) -> Surroundings:
    """The scene with what the parameters say of gravity in place of what is declared."""
    for effect in effects:
        if (gravity := effect.gravity(theta, scene)) is not None:
            scene = replace(scene, gravity=gravity)
    return scene


def infers_gravity(effects: Sequence[Effect]) -> bool:
    """Whether one of the effects puts a parameter in place of the declared gravity."""
    return any(type(effect).gravity is not Effect.gravity for effect in effects)
