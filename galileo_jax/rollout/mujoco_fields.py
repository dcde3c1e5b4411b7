"""The equations of motion as MuJoCo's engines take them: fields, forces, and the way back.

MuJoCo has its own ramp, gravity, contacts and Coulomb friction. What `motion.dynamics` says
beyond them is applied on top, at every recorded step: as a force along the path and as the
contacts' friction coefficients. Written in the array standard, so that the same lines run in
NumPy (C engine) and in JAX (MJX).
"""

import math
from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple

import jax
import numpy as np
from jaxtyping import Float, Int
from mujoco.batch import Batch

from galileo_jax.model.effects.effect import Effect, State, Surroundings
from galileo_jax.rollout.motion import (
    LEAST_FRICTION,
    Array,
    Dynamics,
    OfCentres,
    PerObject,
    to_plane,
)

FOOT_ZONE_M = 0.03  # of the size of an object, which takes so long to cross the edge


class Faces(NamedTuple):
    """Coefficients of restitution, and stiffness (1/s^2) and damping (1/s) with which they come.

    Measured within 0.03. Damping may not outrun the time step, so that a small e stiffens the
    spring first.
    """

    restitution: np.ndarray
    stiffness: np.ndarray
    damping: np.ndarray

    def solref(self, restitution: Array, xp: Any) -> Array:
        """MuJoCo's direct solref (-stiffness, -damping), `[..., 2]`; of e = 0 exactly the first."""
        stiffness = xp.exp(xp.interp(restitution, self.restitution, np.log(self.stiffness)))
        stiffness = xp.where(restitution == 0, self.stiffness[0], stiffness)
        damping = xp.interp(restitution, self.restitution, self.damping)
        return xp.stack([-stiffness, -damping], axis=-1)


# Of scenes/ramp.xml, at 0.3 and 1 m/s (tests/rollout/test_restitution.py); overdamped 17 times
# at e = 0.
BUMPERS = Faces(
    np.array([0.0, 0.0155, 0.046, 0.11, 0.244, 0.295, 0.417, 0.625, 0.783, 0.882, 0.95]),
    np.array([300.0, 3e3, 1e4, 3e4, 1e5, *[1.4e5] * 6]),
    np.array([*[600.0] * 6, 400.0, 200.0, 100.0, 50.0, 20.0]),
)


class Fields(NamedTuple):
    """What one rollout's parameters change before its first step; leading axes `[...]`."""

    mass: PerObject  # kg: the inertia, which is all the mass there is in MuJoCo
    friction: PerObject  # of the object's contacts with ramp and table
    qpos: Array  # `[..., dof]`, x and z of each object's centre relative to its body's place
    qvel: Array  # `[..., dof]`, m/s
    bumper: Array  # `[..., 2]`, (-stiffness, -damping) between objects, MuJoCo's direct solref


class Loads(NamedTuple):
    """What acts besides MuJoCo's own gravity and friction; None where there is nothing."""

    force: Callable[[State], Array] | None  # `State` to generalised forces `[..., dof]`, N
    # `State` to the contacts' coefficients `[..., object]`
    friction: Callable[[State], PerObject] | None
    is_steady: bool  # whether what has come to rest stays so: nothing may depend on the time


def finite(theta: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Parameters `[batch, parameter]` that can be rolled out, and of which rows they are true."""
    theta = np.asarray(theta, float)
    is_good = np.all(np.isfinite(theta), axis=1)
    return np.where(is_good[:, None], theta, 0.5), is_good


def make_fields(law: Dynamics, scene: Surroundings, xp: Any) -> Fields:
    """Maps the equations of motion to the model's fields and the start."""
    declared = xp.asarray(scene.angle_rad)
    place, speed = to_plane(law.start_m, law.start_speed_m_s, declared, 0.0 * declared, scene)
    flat = (*law.inertia.shape[:-1], 2 * len(scene.names))
    return Fields(
        mass=law.inertia,
        friction=law.friction,
        qpos=(place - xp.asarray(scene.start_m)).reshape(flat),
        qvel=speed.reshape(flat),
        bumper=BUMPERS.solref(law.restitution, xp),
    )


def make_loads(
    effects: Sequence[Effect], scene: Surroundings, theta: Mapping[str, Array], law: Dynamics
) -> Loads:
    """What the effects ask for beyond MuJoCo's own ramp, gravity and friction.

    With an inertia M, the declared slope A under the object and MuJoCo's weight M g (g the
    declared gravity):

        force along the path     drive - M g sin A
        coefficient of friction  brake / (M g cos A)

    and past the foot `_foot_drag`. Where slope or inertia differ from MuJoCo's, its factor makes up
    for what MuJoCo's own contact keeps at the foot, too.
    """
    xp = law.mass.__array_namespace__()

    def has(hook: str) -> bool:
        return any(getattr(effect, hook)(theta, scene) is not None for effect in effects)

    is_other_body = has("inertia") or has("tilt") or has("gravity")
    has_foot = scene.has_table and any(scene.comes_down) and (has("foot") or is_other_body)
    angle, weight = scene.angle_rad, law.inertia * scene.gravity
    log_foot = xp.log(xp.clip(law.foot, 0.5, 2.0))[..., None]

    def slope(state: State) -> PerObject:
        return xp.where(state.is_on_ramp, angle, 0.0)

    def friction(state: State) -> PerObject:
        return xp.maximum(law.brake(state) / (weight * xp.cos(slope(state))), LEAST_FRICTION)

    def log_kept(state: State) -> PerObject:
        """The logarithm of the factor past the foot, `[..., object]`."""
        if not is_other_body:
            return log_foot
        turn = (law.ramp_rad - law.table_rad)[..., None]
        kept = xp.cos(turn) - law.coefficient(state) * xp.abs(xp.sin(turn))
        native = math.cos(angle) - friction(state) * math.sin(angle)
        return log_foot + xp.log(xp.clip(kept / native, 0.5, 2.0))

    def force(state: State) -> Array:
        down = slope(state)
        along = law.drive(state) - weight * xp.sin(down)
        if has_foot:
            along = along + _foot_drag(log_kept(state), state, law, scene)
        both = xp.stack([along * xp.cos(down), -along * xp.sin(down)], axis=-1)
        return both.reshape(*both.shape[:-2], -1)

    return Loads(
        force=force if has("force") or has_foot or is_other_body else None,
        friction=friction if has("friction") or is_other_body else None,
        is_steady=not (has("force") or has("friction")),
    )


def _foot_drag(log_kept: Array, state: State, law: Dynamics, scene: Surroundings) -> PerObject:
    """A short zone of drag (or thrust) past the foot, N, for a factor f on the speed there.

        F = M ln(f) w(x) v |v|,   w a raised cosine over the zone with integral 1,

    so that dv/dx = ln(f) w(x) v: what crosses the zone leaves it with f times the speed,
    whatever its speed. `log_kept`: ln(f), alike for all objects, `[..., 1]`.
    """
    xp, speed = law.mass.__array_namespace__(), state.speed_m_s
    comes_down = xp.asarray(scene.comes_down, dtype=law.mass.dtype)
    share = xp.clip(state.path_m / FOOT_ZONE_M, 0.0, 1.0)
    window = (1 - xp.cos(2 * math.pi * share)) / FOOT_ZONE_M
    return law.inertia * comes_down * log_kept * window * speed * xp.abs(speed)


def sliding_objects(compiled: Any) -> tuple[Int[np.ndarray, " sled"], Int[np.ndarray, " sled"]]:
    """The contact pairs of scenes/ramp.xml that carry an object's friction, and which object's.

    The other pairs are those of hits.
    """
    names = [compiled.pair(i).name.split("_") for i in range(compiled.npair)]
    pairs = [i for i, (_, other) in enumerate(names) if not other.startswith("object")]
    return np.array(pairs), np.array([int(names[i][0].removeprefix("object")) - 1 for i in pairs])


def write_contacts(
    batch: Batch,
    compiled: Any,
    friction: Float[np.ndarray, "batch object"],
    faces: Float[np.ndarray, "batch 2"] | None,
) -> None:
    """Writes friction with what carries each object, and how faces are, into a batch's contacts.

    `faces`: MuJoCo's direct solref between objects; None leaves them as they are.
    """
    sleds, objects = sliding_objects(compiled)
    batch.expand("pair_friction")[:, sleds, :2] = friction[:, objects, None]
    if faces is not None:
        hits = np.delete(np.arange(compiled.npair), sleds)
        batch.expand("pair_solref")[:, hits] = faces[:, None]


def to_path(
    position: OfCentres, velocity: OfCentres, scene: Surroundings
) -> tuple[PerObject, PerObject]:
    """Centres, and how fast they go, along the paths parallel to the declared ramp and table.

    They are a little off these where contacts give way.
    """
    xp = position.__array_namespace__()
    cos, sin = math.cos(scene.angle_rad), math.sin(scene.angle_rad)
    down_ramp = velocity[..., 0] * cos - velocity[..., 1] * sin
    if not scene.has_table:
        gone = position - xp.asarray(scene.start_m)
        return gone[..., 0] * cos - gone[..., 1] * sin, down_ramp
    x = position[..., 0] - xp.asarray(scene.corner_m)
    y = position[..., 1] - xp.asarray(scene.half_height_m)
    ramp = x * cos - y * sin
    is_on_ramp = ramp < 0
    path = xp.where(is_on_ramp, ramp, xp.maximum(x, 0.0))
    return path, xp.where(is_on_ramp, down_ramp, velocity[..., 0])


def rigid_motion(
    position: OfCentres, velocity: OfCentres, law: Dynamics, scene: Surroundings
) -> tuple[OfCentres, OfCentres]:
    """Takes the contacts' penetration out of simulated centres, and tilts them truly.

    `position` and `velocity` have a leading axis of records.
    """
    path, speed = to_path(position, velocity, scene)
    if len(scene.names) > 1:
        path = _without_overlap(path, law.inertia, scene)
    return to_plane(path, speed, law.ramp_rad, law.table_rad, scene)


def _without_overlap(path: PerObject, mass: PerObject, scene: Surroundings) -> PerObject:
    """Undoes the overlap of each object's front with the next one's back face.

    Each centre is put back by its share (the other's mass over the sum) of the deepest overlap
    so far, as if the hit had taken no time.
    """
    xp = path.__array_namespace__()
    half = xp.asarray(scene.half_length_m)
    x = path + xp.asarray(scene.corner_m)
    overlap = xp.maximum(x[..., :-1] + half[:-1] - (x[..., 1:] - half[1:]), 0.0)
    if isinstance(overlap, np.ndarray):
        deepest = np.maximum.accumulate(overlap, axis=0)
    else:
        deepest = jax.lax.cummax(overlap, axis=0)
    back = deepest * mass[..., 1:] / (mass[..., :-1] + mass[..., 1:])
    none = xp.zeros_like(path[..., :1])
    pushed_back = xp.concat([back, none], axis=-1)
    pushed_on = xp.concat([none, deepest - back], axis=-1)
    return path - pushed_back + pushed_on
