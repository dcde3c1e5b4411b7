"""The scene: a clip's geometry, and as a MuJoCo model, set up through `mujoco.MjSpec`.

The rigid engine needs no MuJoCo model: it is compiled, and MuJoCo imported, when first asked for.
"""

# mujoco's classes live in a compiled module without stubs.
# pyright: reportAttributeAccessIssue=false

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from galileo_jax.clip.scenarios import SCENARIOS
from galileo_jax.clip.schema import Clip, ClipObject
from galileo_jax.files.package_data import scene_path
from galileo_jax.model.effects.effect import Surroundings
from galileo_jax.model.effects.laws.start_velocity import StartVelocity
from galileo_jax.model.effects.laws.walls import StraightWalls
from galileo_jax.model.scene.expected import expected
from galileo_jax.observation.observation import Observation
from galileo_jax.runtime.errors import InputError

if TYPE_CHECKING:
    import mujoco

TIMESTEP_S = 1 / 960
# Where nothing else is declared; an incline's dynamics do not depend on it.
UNKNOWN_BOX_M: tuple[float, ...] = (0.04, 0.04, 0.04)
UNKNOWN_ROUND_M: tuple[float, ...] = (0.02, 0.01)
EARLY_SHARE = 0.3  # of a fall, before the air makes itself felt; of a way that turns back
# Of the objects beyond the file's two, in turn.
SHAPE_RGBA = ([0.35, 0.60, 0.30, 1], [0.62, 0.45, 0.70, 1], [0.80, 0.36, 0.22, 1])
TURNED = 0.99  # of its way, where what ended nearer has turned back
BUMPER_RADIUS_M = 2.0  # nearly flat: faces that meet at different heights do not climb


@dataclass(frozen=True)
class Scene:
    """A scene; what the rollouts need besides the parameters."""

    surroundings: Surroundings  # names, geometry and start, as effects see them
    objects: tuple[ClipObject, ...]  # as declared
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

    @property
    def has_table(self) -> bool:
        """Whether the ramp ends on a table."""
        return math.isfinite(self.surroundings.corner_m[0])


def extents(declared: ClipObject) -> tuple[float, float]:
    """Half the length along the travel and half the height of an object, m.

    A cylinder stands upright, a torus lies flat, and they slide on their base; where they roll,
    the cylinder lies across the travel and the torus stands on edge.
    """
    unknown = UNKNOWN_BOX_M if declared.shape == "box" else UNKNOWN_ROUND_M
    size = declared.size_m or unknown
    if declared.roll_inertia is not None:
        radius = size[0] + (size[1] if declared.shape == "torus" else 0.0)
        return radius, radius
    match declared.shape:
        case "box":
            return size[0] / 2, size[2] / 2
        case "cylinder":
            return size[0], size[1] / 2
        case "torus":
            return size[0] + size[1], size[1]
        case _:
            return size[0], size[0]


def rolling(objects: Sequence[ClipObject]) -> dict[str, Any]:
    """Which objects roll and their inertias, as `Surroundings` takes them; {} where none does."""
    shares = [declared.roll_inertia for declared in objects]
    if not any(shares):
        return {}
    rolls = tuple(share is not None for share in shares)
    return {"rolls": rolls, "roll_inertia": tuple(share or 0.0 for share in shares)}


def build_scene(clip: Clip, observation: Observation) -> Scene:
    """Sets `scenes/ramp.xml` to the clip: angle, sizes, start positions, gravity.

    Object 1 starts on the ramp where it is first seen (projected onto the surface), every
    other object on the table, in the order of the travel. `incline` is the same scene without
    the table; `fall` (and a spring, a liquid) is an incline straight down, without a board; in
    the plane of a `flight`, and on a table seen from above, there is no path to begin with.

    Raises:
      InputError: an object is never seen, or one stands before the one declared before it.
    """
    scenario = SCENARIOS[clip.scenario]
    has_surface, has_table = scenario.has_surface, scenario.has_table
    if scenario.has_ramp:
        assert clip.ramp_angle_deg is not None  # the clip's own validation
        angle = math.radians(clip.ramp_angle_deg)
    else:
        angle = 0.0 if scenario.moves_in_plane else math.pi / 2
    half = [extents(declared) for declared in clip.objects]
    starts = _starts(clip, observation, [height for _, height in half], angle)
    corner = tuple(h * math.tan(angle / 2) if has_table else math.inf for _, h in half)
    surroundings = Surroundings(
        names=observation.names,
        angle_rad=angle,
        gravity=clip.gravity,
        half_length_m=tuple(length for length, _ in half),
        half_height_m=tuple(height for _, height in half),
        corner_m=corner,
        start_m=starts,
        start_path_m=start_paths(starts, corner, angle),
        has_table=has_table,
        comes_down=tuple(
            has_table and bool(at[0] < c) for at, c in zip(starts, corner, strict=True)
        ),
        release_s=_release(clip, observation, angle),
        is_scale_known=clip.is_scale_known,
        is_scale_stated=clip.pixels_per_metre_sd is not None,
        has_surface=has_surface,
        mass_kg=tuple(declared.mass_kg for declared in clip.objects),
        **(rolling(clip.objects) if scenario.has_ramp else {}),
        is_box=tuple(declared.shape == "box" for declared in clip.objects),
        moves_in_plane=scenario.moves_in_plane,
        laws=laws_of(clip),
        expected=expected(clip, observation, half[0][int(not scenario.is_level)]),
        walls_m=tuple(wall.ends_m for wall in clip.walls),
        way_m=float(np.hypot(*np.ptp(observation.position_m[0, :2, observation.mask[0]], axis=0))),
    )
    return Scene(surroundings, clip.objects)


def _starts(
    clip: Clip, observation: Observation, heights_m: Sequence[float], angle: float
) -> tuple[tuple[float, ...], ...]:
    """The centres at the start, of objects of half these heights; raises as `build_scene`."""
    starts: list[tuple[float, ...]] = []
    for i, (name, height) in enumerate(zip(observation.names, heights_m, strict=True)):
        seen = np.flatnonzero(observation.mask[i])
        if not seen.size:
            raise InputError(f"{clip.path}: {name} is not seen in any frame")
        x, y = observation.position_m[i, :2, seen[0]]
        if not SCENARIOS[clip.scenario].has_table:
            starts.append(tuple(map(float, observation.position_m[i, :, seen[0]])))
        elif i == 0:
            along = x * math.cos(angle) - y * math.sin(angle)
            starts.append(_on_ramp(along, height, angle))
        else:
            starts.append((float(x), height))
            if x < starts[i - 1][0]:
                raise InputError(
                    f"{clip.path}: objects[{i}]: {name} stands before {observation.names[i - 1]}; "
                    "objects in the order of the travel expected"
                )
    return tuple(starts)


def laws_of(clip: Clip) -> tuple[str, ...]:
    """The scenario's laws, and those that the clip's keys bring."""
    declared = (
        ("floor", clip.has_floor),
        (StartVelocity.name, clip.starts_moving is True),
        (StraightWalls.name, bool(clip.walls)),
    )
    return SCENARIOS[clip.scenario].laws + tuple(name for name, is_there in declared if is_there)


def start_paths(
    starts: tuple[tuple[float, ...], ...], corners: tuple[float, ...], angle: float
) -> tuple[float, ...]:
    """How far each start `(x, y)` is past the foot, along the path; 0 without a table."""
    paths = []
    for (x, *_), corner in zip(starts, corners, strict=True):
        past = x - corner if math.isfinite(corner) else 0.0
        paths.append(past / math.cos(angle) if past < 0 else past)
    return tuple(paths)


def _release(clip: Clip, observation: Observation, angle: float) -> tuple[float, float]:
    """When object 1 is let go: expected, and its standard deviation, s.

    On a ramp clip it is the first frame, within a third of a frame, unless that is declared to
    be unknown. On others it is where the motion begins: from rest the distance grows as
    (t - release)^2, so that its root is a straight line which meets zero at the release.
    """
    steps_s = np.diff(observation.times_s)
    frame_s = float(np.median(steps_s)) if steps_s.size else 1.0 / clip.fps
    declared = clip.objects[0].first_frame
    if StartVelocity.name in laws_of(clip) or SCENARIOS[clip.scenario].is_level:
        return float(observation.times_s[np.argmax(observation.mask[0])]), frame_s
    if clip.scenario == "ramp" and declared is not None:
        return float(observation.times_s[declared]), frame_s / 3
    seen = np.flatnonzero(observation.mask[0])
    times, place = observation.times_s[seen], observation.position_m[0][:, seen]
    gone = (place[0] - place[0, 0]) * math.cos(angle) - (place[1] - place[1, 0]) * math.sin(angle)
    if SCENARIOS[clip.scenario].has_table:
        gone = np.where(place[0] < 0, gone, 0.0)
    moving = gone > 0.05 * gone.max()
    if clip.scenario == "fall" or gone[-1] < TURNED * gone.max():
        moving &= gone < EARLY_SHARE * gone.max()
        moving &= np.arange(len(gone)) <= np.argmax(gone)  # it may come back up
    if gone.max() <= 0 or moving.sum() < 3:
        return float(times[0]), frame_s
    slope, intercept = np.polyfit(times[moving], np.sqrt(gone[moving]), 1)
    if slope <= 0:
        return float(times[0]), frame_s
    release = float(np.clip(-intercept / slope, times[0], times[-1]))
    return release, max(3 * frame_s, 0.05)


def _on_ramp(along: float, height: float, angle: float) -> tuple[float, float]:
    """The centre of an object that stands `along` metres past the foot, on the ramp."""
    return (
        along * math.cos(angle) + height * math.sin(angle),
        -along * math.sin(angle) + height * math.cos(angle),
    )


def _spec(surroundings: Surroundings, declared: tuple[ClipObject, ...]) -> "mujoco.MjSpec":
    import mujoco

    spec = mujoco.MjSpec.from_file(str(scene_path("ramp.xml")))
    spec.option.gravity = [0, 0, -surroundings.gravity]
    has_table = math.isfinite(surroundings.corner_m[0])
    if not surroundings.has_surface:
        for pair in list(spec.pairs):
            if "ramp" in (pair.geomname1, pair.geomname2):
                spec.delete(pair)
        spec.delete(spec.geom("ramp"))
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
        for pair in list(spec.pairs):
            if "table" in (pair.geomname1, pair.geomname2):
                spec.delete(pair)
        spec.delete(spec.geom("table"))
    return spec


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
    geom: "mujoco.MjsGeom", shape: str, declared: ClipObject, length: float, height: float
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
