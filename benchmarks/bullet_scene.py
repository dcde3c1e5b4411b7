"""The ramp experiment in PyBullet, as the thesis has it or as well as the engine can.

Optional: `pip install -e '.[bullet]'`.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import pybullet  # pyright: ignore

from galileo_jax.simulation.truth import Truth

STEP_S = 1 / 240
FINE_STEP_S = 1 / 960
DEPTH_M = 0.06
SLAB_M = 0.05


@dataclass(frozen=True)
class Hidden:
    """What else there is in the world, in its own terms; every default is nothing.

    Attributes:
      force: N `[object, 3]` at the centres (x along the travel, z up), from centres and velocities
        `[object, 3]`.
      friction: the objects' coefficients `[object]`, from the same.
      restitution: of the objects' hit.
      start_m_s: object 1's speed down the ramp when it is let go.
      table_rad: how much the table falls away from the ramp.
    """

    force: Callable[[np.ndarray, np.ndarray], np.ndarray] | None = None
    friction: Callable[[np.ndarray, np.ndarray], np.ndarray] | None = None
    restitution: float = 0.0
    start_m_s: float = 0.0
    table_rad: float = 0.0


NOTHING = Hidden()


def roll_out(
    truth: Truth,
    num_steps: int,
    client: int,
    is_fine: bool = False,
    hidden: Hidden = NOTHING,
) -> np.ndarray:
    """Builds the world anew, as the thesis does for every rollout, and steps it.

    Friction is multiplied in Bullet: with 1 on ramp and table the boxes' own counts.

    Args:
      truth: the experiment.
      num_steps: of `STEP_S`, or of `FINE_STEP_S`.
      client: of PyBullet.
      is_fine: not as the thesis has it (240 Hz and the engine's defaults: it slows everything by
        4 % a second, and boxes sink 3 mm into the plane), but small steps, no damping, and a table
        that is a box.
      hidden: what else there is.

    Returns:
      the centres `[step + 1, object, 2]`, m, at the start and at the end of each step.
    """
    where, angle = truth.surroundings, truth.angle_rad
    pybullet.resetSimulation(physicsClientId=client)
    pybullet.setGravity(0, 0, -truth.gravity, physicsClientId=client)
    down, away = (pybullet.getQuaternionFromEuler((0, a, 0)) for a in (angle, hidden.table_rad))
    length, thickness = 1.0, SLAB_M
    if is_fine:
        pybullet.setPhysicsEngineParameter(
            fixedTimeStep=FINE_STEP_S, numSolverIterations=200, physicsClientId=client
        )
        board = pybullet.createCollisionShape(
            pybullet.GEOM_BOX, halfExtents=(2 * length, 1, thickness), physicsClientId=client
        )
        table = pybullet.createMultiBody(
            0,
            board,
            basePosition=_tilted(2 * length, -thickness, hidden.table_rad),
            baseOrientation=away,
            physicsClientId=client,
        )
    else:
        plane = pybullet.createCollisionShape(pybullet.GEOM_PLANE, physicsClientId=client)
        table = pybullet.createMultiBody(0, plane, physicsClientId=client)
    slab = pybullet.createCollisionShape(
        pybullet.GEOM_BOX, halfExtents=(length, 1, thickness), physicsClientId=client
    )
    x = -length * math.cos(angle) - thickness * math.sin(angle)
    z = length * math.sin(angle) - thickness * math.cos(angle)
    ramp = pybullet.createMultiBody(
        0, slab, basePosition=(x, 0, z), baseOrientation=down, physicsClientId=client
    )
    for surface in (table, ramp):
        pybullet.changeDynamics(surface, -1, lateralFriction=1.0, physicsClientId=client)
    objects = []
    for i, (x, height) in enumerate(where.start_m):
        half = (where.half_length_m[i], DEPTH_M / 2, where.half_height_m[i])
        box = pybullet.createCollisionShape(
            pybullet.GEOM_BOX, halfExtents=half, physicsClientId=client
        )
        objects.append(
            pybullet.createMultiBody(
                truth.mass_kg[i],
                box,
                basePosition=(x, 0, height) if i == 0 else _tilted(x, height, hidden.table_rad),
                baseOrientation=down if i == 0 else away,
                physicsClientId=client,
            )
        )
        pybullet.changeDynamics(
            objects[i], -1, lateralFriction=truth.friction[i], physicsClientId=client
        )
        if is_fine:
            pybullet.changeDynamics(
                objects[i], -1, linearDamping=0.0, angularDamping=0.0, physicsClientId=client
            )
        if hidden.restitution:  # Bullet multiplies them
            pybullet.changeDynamics(
                objects[i], -1, restitution=math.sqrt(hidden.restitution), physicsClientId=client
            )
    speed = hidden.start_m_s
    pybullet.resetBaseVelocity(
        objects[0], (speed * math.cos(angle), 0, -speed * math.sin(angle)), physicsClientId=client
    )
    path = np.empty((num_steps + 1, 2, 2))
    for step in range(num_steps + 1):
        if step:
            _act(objects, hidden, client)
            pybullet.stepSimulation(physicsClientId=client)
        for i, body in enumerate(objects):
            place, _ = pybullet.getBasePositionAndOrientation(body, physicsClientId=client)
            path[step, i] = place[0], place[2]
    return path


def _act(objects: list[int], hidden: Hidden, client: int) -> None:
    """Makes what is hidden act in the next step."""
    if hidden.force is None and hidden.friction is None:
        return
    states = [
        (
            pybullet.getBasePositionAndOrientation(body, physicsClientId=client)[0],
            pybullet.getBaseVelocity(body, physicsClientId=client)[0],
        )
        for body in objects
    ]
    place, velocity = (np.array(each) for each in zip(*states, strict=True))
    if hidden.force is not None:
        forces = hidden.force(place, velocity)
        for body, at, force in zip(objects, place, forces, strict=True):
            pybullet.applyExternalForce(
                body, -1, list(force), list(at), pybullet.WORLD_FRAME, physicsClientId=client
            )
    if hidden.friction is not None:
        for body, k in zip(objects, hidden.friction(place, velocity), strict=True):
            pybullet.changeDynamics(body, -1, lateralFriction=float(k), physicsClientId=client)


def _tilted(x: float, z: float, angle: float) -> tuple[float, float, float]:
    """A point of the level table, where the table falls away by `angle` about the foot."""
    cos, sin = math.cos(angle), math.sin(angle)
    return (x * cos + z * sin, 0.0, z * cos - x * sin)
