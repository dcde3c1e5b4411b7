"""The ramp experiment in PyBullet, as the thesis has it: 240 Hz, the engine's defaults.

Optional: `pip install -e '.[bullet]'`.
"""

import math

import numpy as np
import pybullet  # pyright: ignore

from galileo_jax.simulation.truth import Truth

STEP_S = 1 / 240
DEPTH_M = 0.06


def roll_out(truth: Truth, num_steps: int, client: int) -> np.ndarray:
    """Builds the world anew, as the thesis does for every rollout, and steps it.

    Friction is multiplied in Bullet: with 1 on ramp and table the boxes' own counts.

    Returns:
      the centres `[step + 1, object, 2]`, m, at the start and at the end of each step.
    """
    where, angle = truth.surroundings, truth.angle_rad
    pybullet.resetSimulation(physicsClientId=client)
    pybullet.setGravity(0, 0, -truth.gravity, physicsClientId=client)
    plane = pybullet.createCollisionShape(pybullet.GEOM_PLANE, physicsClientId=client)
    table = pybullet.createMultiBody(0, plane, physicsClientId=client)
    down = pybullet.getQuaternionFromEuler((0, angle, 0))
    length, thickness = 1.0, 0.05
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
    path = np.empty((num_steps + 1, 2, 2))
    for step in range(num_steps + 1):
        if step:
            pybullet.stepSimulation(physicsClientId=client)
        for i, body in enumerate(objects):
            place, _ = pybullet.getBasePositionAndOrientation(body, physicsClientId=client)
            path[step, i] = place[0], place[2]
    return path
