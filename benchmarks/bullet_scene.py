"""The ramp experiment in PyBullet, as well as the engine can.

Small steps, no damping, and a table that is a box: by default the engine slows everything by 4 % a
second, and boxes sink 3 mm into a plane. Optional: `pip install -e '.[bullet]'`.
"""

import math
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
import pybullet  # pyright: ignore

from galileo_jax.simulation.truth import Truth

STEP_S = 1 / 960
DEPTH_M = 0.06
SLAB_M = 0.05
LENGTH_M = 1.0

Law = Callable[[np.ndarray, np.ndarray], np.ndarray]
"""Of the objects, from their centres and velocities `[object, 3]` (x along the travel, z up)."""


class World(NamedTuple):
    """What else there is in an experiment, in its own terms; every default is nothing."""

    force: Law | None = None  # N `[object, 3]` at the centres
    friction: Law | None = None  # the objects' coefficients `[object]`
    restitution: float = 0.0  # of the objects' hit
    start_m_s: float = 0.0  # object 1's speed down the ramp when it is let go
    table_rad: float = 0.0  # how much the table falls away from the ramp
    # what is declared wrongly (see `bullet_effects.film`)
    steeper_rad: float = 0.0
    late_s: float = 0.0
    longer: float = 0.0
    slower: float = 0.0


NOTHING = World()


def roll_out(truth: Truth, num_steps: int, hidden: World = NOTHING) -> np.ndarray:
    """Builds the world and steps it.

    Friction is multiplied in Bullet: with 1 on ramp and table the boxes' own counts.

    Returns:
      the centres `[object, 2, step + 1]`, m, at the start and at the end of each step.
    """
    pybullet.connect(pybullet.DIRECT)
    try:
        objects = _build(truth, hidden)
        path = np.empty((2, 2, num_steps + 1))
        for step in range(num_steps + 1):
            if step:
                _act(objects, hidden)
                pybullet.stepSimulation()
            for i, body in enumerate(objects):
                place, _ = pybullet.getBasePositionAndOrientation(body)
                path[i, :, step] = place[0], place[2]
    finally:
        pybullet.disconnect()
    return path


def _build(truth: Truth, hidden: World) -> list[int]:
    """The two objects, on their ramp and table."""
    where, angle = truth.surroundings, truth.angle_rad
    down, away = (pybullet.getQuaternionFromEuler((0, a, 0)) for a in (angle, hidden.table_rad))
    pybullet.setGravity(0, 0, -truth.gravity)
    pybullet.setPhysicsEngineParameter(fixedTimeStep=STEP_S, numSolverIterations=200)
    table = _tilted(2 * LENGTH_M, -SLAB_M, hidden.table_rad)
    x = -LENGTH_M * math.cos(angle) - SLAB_M * math.sin(angle)
    z = LENGTH_M * math.sin(angle) - SLAB_M * math.cos(angle)
    _box((2 * LENGTH_M, 1, SLAB_M), 0, table, away, lateralFriction=1.0)
    _box((LENGTH_M, 1, SLAB_M), 0, (x, 0, z), down, lateralFriction=1.0)
    objects = []
    for i, (x, height) in enumerate(where.start_m):
        objects.append(
            _box(
                (where.half_length_m[i], DEPTH_M / 2, where.half_height_m[i]),
                truth.mass_kg[i],
                (x, 0, height) if i == 0 else _tilted(x, height, hidden.table_rad),
                down if i == 0 else away,
                lateralFriction=truth.friction[i],
                linearDamping=0.0,
                angularDamping=0.0,
                restitution=math.sqrt(hidden.restitution),  # Bullet multiplies them
            )
        )
    speed = hidden.start_m_s
    pybullet.resetBaseVelocity(objects[0], (speed * math.cos(angle), 0, -speed * math.sin(angle)))
    return objects


def _box(half: Any, mass_kg: float, place: Any, turned: Any, **dynamics: float) -> int:
    shape = pybullet.createCollisionShape(pybullet.GEOM_BOX, halfExtents=half)
    body = pybullet.createMultiBody(mass_kg, shape, basePosition=place, baseOrientation=turned)
    pybullet.changeDynamics(body, -1, **dynamics)
    return body


def _act(objects: list[int], hidden: World) -> None:
    """Makes what is hidden act in the next step."""
    if hidden.force is None and hidden.friction is None:
        return
    place = np.array([pybullet.getBasePositionAndOrientation(body)[0] for body in objects])
    velocity = np.array([pybullet.getBaseVelocity(body)[0] for body in objects])
    if hidden.force is not None:
        forces = hidden.force(place, velocity)
        for body, at, force in zip(objects, place, forces, strict=True):
            pybullet.applyExternalForce(body, -1, list(force), list(at), pybullet.WORLD_FRAME)
    if hidden.friction is not None:
        for body, k in zip(objects, hidden.friction(place, velocity), strict=True):
            pybullet.changeDynamics(body, -1, lateralFriction=float(k))


def _tilted(x: float, z: float, angle: float) -> tuple[float, float, float]:
    """A point of the level table, where the table falls away by `angle` about the foot."""
    cos, sin = math.cos(angle), math.sin(angle)
    return (x * cos + z * sin, 0.0, z * cos - x * sin)
