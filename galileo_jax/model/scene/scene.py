"""The scene: a clip's geometry, and as a MuJoCo model, set up through `mujoco.MjSpec`.

The rigid engine needs no MuJoCo model: it is compiled, and MuJoCo imported, when first asked for.
"""

# mujoco's classes live in a compiled module without stubs.
# pyright: reportAttributeAccessIssue=false

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any, Protocol, runtime_checkable

from galileo_jax.files.package_data import scene_path
from galileo_jax.model.effects.effect import Surroundings

if TYPE_CHECKING:
    import mujoco

TIMESTEP_S = 1 / 960
# Of the objects beyond the file's two, in turn.
SHAPE_RGBA = ([0.35, 0.60, 0.30, 1], [0.62, 0.45, 0.70, 1], [0.80, 0.36, 0.22, 1])
BUMPER_RADIUS_M = 2.0  # nearly flat: faces that meet at different heights do not climb


@runtime_checkable
class Solid(Protocol):
    """What is drawn of an object, and touches where it moves freely."""

    @property
    def shape(self) -> str:
        """box, cylinder, torus, or sphere."""
        ...

    @property
    def size_m(self) -> tuple[float, ...] | None:
        """As declared, m: a box's edges, or radii and height; None where nobody knows."""
        ...

    @property
    def roll_inertia(self) -> float | None:
        """Its moment of inertia over m r^2; None where it slides."""
        ...

    @property
    def z_m(self) -> float:
        """How far its centre is from the plane of the motion, towards the camera."""
        ...


@dataclass(frozen=True)
class Scene:
    """A scene; what the rollouts need besides the parameters."""

    surroundings: Surroundings  # names, geometry and start, as effects see them
    objects: tuple[Solid, ...]
    timestep_s: float = TIMESTEP_S  # of MuJoCo's engines

    @property
    def spec(self) -> "mujoco.MjSpec":
        """The MjSpec the model was compiled from (for pictures and the viewer)."""
        return self._compiled[0]

    @property
    def model(self) -> "mujoco.MjModel":
        """The compiled model, its masses and frictions still the file's."""
        return self._compiled[1]

    @cached_property
    def _compiled(self) -> "tuple[mujoco.MjSpec, mujoco.MjModel]":
        spec = _spec(self.surroundings, self.objects)
        spec.option.timestep = self.timestep_s
        return spec, spec.compile()

    @property
    def z_m(self) -> tuple[float, ...]:
        """`[object]`, how far each centre is from the plane of the motion, towards the camera.

        The planar scene has no use for it.
        """
        return tuple(each.z_m for each in self.objects)

    @property
    def shapes(self) -> tuple[str, ...]:
        """`[object]`, what is drawn of each."""
        return tuple(each.shape for each in self.objects)

    @property
    def names(self) -> tuple[str, ...]:
        """The objects' names."""
        return self.surroundings.names


def laid_out(
    half_m: Sequence[tuple[float, float]],
    start_m: tuple[tuple[float, ...], ...],
    angle_rad: float,
    has_table: bool,
) -> dict[str, Any]:
    """Sizes and places as `Surroundings` takes them, of half lengths and heights, and starts."""
    bend = math.tan(angle_rad / 2) if has_table else math.inf
    corner_m = tuple(height * bend for _, height in half_m)
    past_m = [
        x - corner if has_table else 0.0 for (x, *_), corner in zip(start_m, corner_m, strict=True)
    ]
    return {
        "half_length_m": tuple(length for length, _ in half_m),
        "half_height_m": tuple(height for _, height in half_m),
        "corner_m": corner_m,
        "start_m": start_m,
        "start_path_m": tuple(x / math.cos(angle_rad) if x < 0 else x for x in past_m),
        "has_table": has_table,
        "comes_down": tuple(bool(x < 0) for x in past_m),
    }


def on_ramp(along_m: float, height_m: float, angle_rad: float) -> tuple[float, float]:
    """The centre of an object of half this height that stands `along_m` past the foot."""
    cos, sin = math.cos(angle_rad), math.sin(angle_rad)
    return along_m * cos + height_m * sin, -along_m * sin + height_m * cos


def _spec(surroundings: Surroundings, declared: tuple[Solid, ...]) -> "mujoco.MjSpec":
    import mujoco

    spec = mujoco.MjSpec.from_file(str(scene_path("ramp.xml")))
    spec.option.gravity = [0, 0, -surroundings.gravity]
    has_table = surroundings.has_table
    if not surroundings.has_surface:
        _delete_surface(spec, "ramp")
    elif not has_table:
        # The board is where the object is seen to stand, whatever its height.
        (x, y, *_), height = surroundings.start_m[0], surroundings.half_height_m[0]
        sin, cos = math.sin(surroundings.angle_rad), math.cos(surroundings.angle_rad)
        spec.geom("ramp").pos = [x - height * sin, 0, y - height * cos]
    if surroundings.has_surface:
        spec.geom("ramp").alt.euler = [0, math.degrees(surroundings.angle_rad), 0]
    count = len(surroundings.names)
    if count < 2:
        spec.delete(spec.body("object2"))
    for i in range(2, count):
        _add_object(spec, i)
    for i in range(count):
        name = f"object{i + 1}"
        length, height = surroundings.half_length_m[i], surroundings.half_height_m[i]
        x, y = surroundings.start_m[i][:2]
        spec.body(name).pos = [x, 0, y]
        spec.geom(f"{name}_sled").size = [height, 0, 0]
        # Bumpers meet at the height of object 1's centre, so that a push has no lift.
        lift = surroundings.half_height_m[0] - height
        for face, forward in (("front", 1), ("back", -1)):
            if (bumper := spec.geom(f"{name}_{face}")) is not None:
                bumper.size = [BUMPER_RADIUS_M, 0, 0]
                bumper.pos = [forward * (length - BUMPER_RADIUS_M), 0, lift]
        shape = spec.geom(f"{name}_shape")
        rolls = declared[i].roll_inertia is not None
        kind = "sphere" if rolls else declared[i].shape
        _draw(shape, kind, declared[i], length, height)
    if not has_table:
        _delete_surface(spec, "table")
    return spec


def _delete_surface(spec: "mujoco.MjSpec", name: str) -> None:
    for pair in list(spec.pairs):
        if name in (pair.geomname1, pair.geomname2):
            spec.delete(pair)
    spec.delete(spec.geom(name))


def _add_object(spec: "mujoco.MjSpec", i: int) -> None:
    """Adds object i (counted from 0) behind the last one, as object 2 stands in the file."""
    name, before = f"object{i + 1}", f"object{i}"
    like, table, hit = (
        spec.body("object2"),
        spec.pair("object2_table"),
        spec.pair("object1_object2"),
    )
    body = spec.worldbody.add_body(name=name, mass=like.mass, inertia=like.inertia)
    body.explicitinertial = True
    for joint in like.joints:
        axis = joint.name.removeprefix("object2")
        body.add_joint(name=f"{name}{axis}", type=joint.type, axis=joint.axis)
    for part, kind in (("sled", "sled"), ("back", "bumper"), ("shape", "shape")):
        body.add_geom(spec.find_default(kind), name=f"{name}_{part}")
    spec.geom(f"{name}_shape").rgba = SHAPE_RGBA[i % len(SHAPE_RGBA)]
    spec.body(before).add_geom(spec.find_default("bumper"), name=f"{before}_front")
    _add_pair(spec, table, f"{name}_table", "table", f"{name}_sled")
    _add_pair(spec, hit, f"{before}_{name}", f"{before}_front", f"{name}_back")


def _add_pair(
    spec: "mujoco.MjSpec", like: "mujoco.MjsPair", name: str, one: str, other: str
) -> None:
    spec.add_pair(
        name=name,
        geomname1=one,
        geomname2=other,
        condim=like.condim,
        friction=like.friction,
        solref=like.solref,
        solimp=like.solimp,
    )


def _draw(
    geom: "mujoco.MjsGeom", shape: str, declared: Solid, length: float, height: float
) -> None:
    """Sets the drawn (not touching) geom to the declared shape; a torus is drawn as a disc."""
    import mujoco

    depth = length
    if shape == "box" and declared.size_m is not None:
        depth = declared.size_m[1] / 2
    match shape:
        case "box":
            geom.type, geom.size = mujoco.mjtGeom.mjGEOM_BOX, [length, depth, height]
        case "sphere":
            geom.type, geom.size = mujoco.mjtGeom.mjGEOM_SPHERE, [length, 0, 0]
        case _:
            geom.type, geom.size = mujoco.mjtGeom.mjGEOM_CYLINDER, [length, height, 0]
