"""What both engines share: set-up from the parameters, forces, the path, the pitch.

Written in the array standard, so that the same lines run in NumPy (C engine) and in JAX.
"""

import functools
import math
import operator
from collections.abc import Mapping
from typing import Any, NamedTuple

import jax
import numpy as np

from galileo_jax.effects.effect import Force, Surroundings
from galileo_jax.rollout.model import Model

Array = Any

# Coefficient of restitution against the bumpers' stiffness (1/s^2) and damping (1/s), measured
# on this scene at 0.3 and 1 m/s (tests/rollout/test_restitution.py): above 600/s the damping
# would outrun the time step, so that a small e stiffens the spring first.
RESTITUTION = np.array([0.0, 0.0155, 0.046, 0.11, 0.244, 0.295, 0.417, 0.625, 0.783, 0.882, 0.95])
STIFFNESS = np.array([300.0, 3e3, 1e4, 3e4, 1e5, 1.4e5, 1.4e5, 1.4e5, 1.4e5, 1.4e5, 1.4e5])
DAMPING = np.array([600.0, 600.0, 600.0, 600.0, 600.0, 600.0, 400.0, 200.0, 100.0, 50.0, 20.0])
# MuJoCo's own least (mjMINMU); MJX does not keep to it, and at 0 its elliptic cone sticks.
LEAST_FRICTION = 1e-5


class SetUp(NamedTuple):
    """What one rollout's parameters change in the compiled model; leading axes `[...]`.

    Attributes:
      mass: `[..., object]`, kg.
      friction: `[..., object]`.
      qpos: `[..., dof]`, x and z of each object's centre relative to its body's place.
      bumper: `[..., 2]`, (-stiffness, -damping) between objects, MuJoCo's direct solref.
    """

    mass: Array
    friction: Array
    qpos: Array
    bumper: Array


def set_up(model: Model, theta: Mapping[str, Array], xp: Any) -> SetUp:
    """Maps parameters (each `[...]`) to the model's fields."""
    surroundings = model.scene.surroundings
    count = len(surroundings.names)
    mass = xp.stack([theta[f"m{i + 1}"] for i in range(count)], axis=-1)
    given = xp.stack([theta[f"k{i + 1}"] for i in range(count)], axis=-1)
    friction = xp.maximum(given, LEAST_FRICTION)
    start = xp.asarray(surroundings.start_m)
    moved = xp.broadcast_to(start, (*mass.shape, 2))
    restitution = xp.zeros(mass.shape[:-1])
    for effect in model.effects + model.nuisances:
        moved = effect.start(moved, theta, surroundings)
        given = effect.restitution(theta, surroundings)
        restitution = restitution if given is None else restitution + given
    qpos = (moved - start).reshape(*mass.shape[:-1], 2 * count)
    return SetUp(mass, friction, qpos, bumper_solref(restitution, xp))


def sliding_object(pair: str) -> int | None:
    """Which object's friction a contact pair of scenes/ramp.xml carries; None for the hit."""
    first, second = pair.split("_")
    return None if second.startswith("object") else int(first.removeprefix("object")) - 1


def bumper_solref(restitution: Array, xp: Any) -> Array:
    """The bumpers' (-stiffness, -damping) for a coefficient of restitution, within 0.03.

    0 gives scenes/ramp.xml's own values exactly: overdamped 17 times, e < 0.002.
    """
    stiffness = xp.exp(xp.interp(restitution, RESTITUTION, np.log(STIFFNESS)))
    stiffness = xp.where(restitution == 0, STIFFNESS[0], stiffness)
    damping = xp.interp(restitution, RESTITUTION, DAMPING)
    return xp.stack([-stiffness, -damping], axis=-1)


def total_force(model: Model, theta: Mapping[str, Array]) -> Force | None:
    """The sum of all effects' forces as a function of the state; None where there is none."""
    given = [
        effect.force(theta, model.scene.surroundings) for effect in model.effects + model.nuisances
    ]
    forces = [force for force in given if force is not None]
    if not forces:
        return None
    return lambda state: functools.reduce(operator.add, (force(state) for force in forces))


def rigid_motion(
    position: Array, velocity: Array, mass: Array, surroundings: Surroundings
) -> tuple[Array, Array]:
    """Takes the contacts' penetration out of simulated centres.

    Between objects: while two faces overlap, each centre is put back by its share (the other's
    mass over the sum) of the deepest overlap so far, as if the hit had taken no time. Onto the
    surfaces: every centre runs parallel to ramp and table at the object's half height, and is
    put there at the same distance along the surface it is on.

    Args:
      position: `[record, ..., object, 2]`, m.
      velocity: `[record, ..., object, 2]`, m/s.
      mass: `[..., object]`, kg.
      surroundings: the scene's geometry.

    Returns:
      positions and velocities of the same shapes.
    """
    if len(surroundings.names) > 1:
        position = _without_overlap(position, mass, surroundings)
    return _along_path(position, velocity, surroundings)


def _without_overlap(position: Array, mass: Array, surroundings: Surroundings) -> Array:
    """Undoes the overlap of object 1's front and object 2's back face."""
    xp = position.__array_namespace__()
    reach = surroundings.half_length_m[0] + surroundings.half_length_m[1]
    overlap = xp.maximum(position[..., 0, 0] - position[..., 1, 0] + reach, 0.0)
    if isinstance(overlap, np.ndarray):
        deepest = np.maximum.accumulate(overlap, axis=0)
    else:
        deepest = jax.lax.cummax(overlap, axis=0)
    total = mass[..., 0] + mass[..., 1]
    back = xp.stack([-mass[..., 1] / total, mass[..., 0] / total], axis=-1)
    moved = deepest[..., None] * back
    return position + xp.stack([moved, xp.zeros_like(moved)], axis=-1)


def _along_path(
    position: Array, velocity: Array, surroundings: Surroundings
) -> tuple[Array, Array]:
    """Puts centres onto the paths parallel to ramp and table."""
    xp = position.__array_namespace__()
    cos, sin = math.cos(surroundings.angle_rad), math.sin(surroundings.angle_rad)
    height = xp.asarray(surroundings.half_height_m)
    has_table = math.isfinite(surroundings.corner_m[0])
    corner = xp.asarray(surroundings.corner_m if has_table else np.zeros(height.shape))
    x, y = position[..., 0] - corner, position[..., 1] - height
    u, w = velocity[..., 0], velocity[..., 1]
    ramp, ramp_speed = x * cos - y * sin, u * cos - w * sin
    if not has_table:
        # `height` above the surface at x = 0 is not the start's; keep the start's own line.
        start = xp.asarray(surroundings.start_m)
        gone = (position[..., 0] - start[:, 0]) * cos - (position[..., 1] - start[:, 1]) * sin
        path = xp.stack([start[:, 0] + gone * cos, start[:, 1] - gone * sin], axis=-1)
        return path, xp.stack([ramp_speed * cos, -ramp_speed * sin], axis=-1)
    is_above = ramp < 0
    table = xp.where(is_above, x, xp.maximum(x, 0.0))
    path = xp.stack(
        [
            corner + xp.where(is_above, ramp * cos, table),
            height + xp.where(is_above, -ramp * sin, 0.0),
        ],
        axis=-1,
    )
    speed = xp.stack(
        [xp.where(is_above, ramp_speed * cos, u), xp.where(is_above, -ramp_speed * sin, 0.0)],
        axis=-1,
    )
    return path, speed


def pitch(position: Array, surroundings: Surroundings) -> Array:
    """How far each drawn object is turned, rad: -angle on the ramp, 0 on the table.

    While an object's length spans the foot it turns evenly per metre. `position`:
    `[..., object, 2]`; returns `[..., object]`.
    """
    xp = position.__array_namespace__()
    if not math.isfinite(surroundings.corner_m[0]):
        return xp.full(position.shape[:-1], -surroundings.angle_rad)
    half = xp.asarray(surroundings.half_length_m)
    corner = xp.asarray(surroundings.corner_m)
    share = xp.clip((position[..., 0] - corner + half) / (2 * half), 0.0, 1.0)
    return -surroundings.angle_rad * (1 - share)
