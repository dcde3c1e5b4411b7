"""The ramp experiment in PyBullet, as the thesis has it or as well as the engine can.

Optional: `pip install -e '.[bullet]'`.
"""

import math

import numpy as np
import pybullet  # pyright: ignore

from galileo_jax.simulation.truth import Truth

STEP_S = 1 / 240
FINE_STEP_S = 1 / 960
DEPTH_M = 0.06


def roll_out(truth: Truth, num_steps: int, client: int, is_fine: bool = False) -> np.ndarray:
    """Builds the world anew, as the thesis does for every rollout, and steps it.

    Friction is multiplied in Bullet: with 1 on ramp and table the boxes' own counts.

    Args:
      truth: the experiment.
      num_steps: of `STEP_S`, or of `FINE_STEP_S`.
      client: of PyBullet.
      is_fine: not as the thesis has it (240 Hz and the engine's defaults: it slows everything by
        4 % a second, and boxes sink 3 mm into the plane), but small steps, no damping, and a table
        that is a box.

    Returns:
      the centres `[step + 1, object, 2]`, m, at the start and at the end of each step.
    """
    where, angle = truth.surroundings, truth.angle_rad
    pybullet.resetSimulation(physicsClientId=client)
    pybullet.setGravity(0, 0, -truth.gravity, physicsClientId=client)
    down = pybullet.getQuaternionFromEuler((0, angle, 0))
    length, thickness = 1.0, 0.05
    if is_fine:
        pybullet.setPhysicsEngineParameter(
            fixedTimeStep=FINE_STEP_S, numSolverIterations=200, physicsClientId=client
        )
        board = pybullet.createCollisionShape(
            pybullet.GEOM_BOX, halfExtents=(2 * length, 1, thickness), physicsClientId=client
        )
        table = pybullet.createMultiBody(
            0, board, basePosition=(2 * length, 0, -thickness), physicsClientId=client
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
                basePosition=(x, 0, height),
                baseOrientation=down if i == 0 else (0, 0, 0, 1),
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
    path = np.empty((num_steps + 1, 2, 2))
    for step in range(num_steps + 1):
        if step:
            pybullet.stepSimulation(physicsClientId=client)
        for i, body in enumerate(objects):
            place, _ = pybullet.getBasePositionAndOrientation(body, physicsClientId=client)
            path[step, i] = place[0], place[2]
    return path
