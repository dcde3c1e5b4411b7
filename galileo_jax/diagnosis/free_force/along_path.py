"""A rollout's motion along the path of each object."""

import numpy as np

from galileo_jax.inference.problem import Problem
from galileo_jax.rollout.motion import dynamics


def along_path(problem: Problem, theta: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Times `[record]`, s; path (m) and speed (m/s) `[object, record]` of a rollout.

    Args:
      problem: whose model is rolled out.
      theta: `[model parameter]`, in their units.
    """
    model = problem.model
    scene = model.scene.surroundings
    position, velocity = (values[0] for values in problem.engine.simulate(theta[None]))
    law = dynamics(model.effects + model.nuisances, scene, model.by_name(theta[None]), np)
    if scene.has_table:
        corner = np.asarray(scene.corner_m)
        origin = np.stack([corner, np.asarray(scene.half_height_m)], axis=1)
        slope = np.where(position[:, 0] < corner[:, None], law.ramp_rad, law.table_rad)
    else:
        origin = np.asarray(scene.start_m)
        slope = np.broadcast_to(law.ramp_rad, position[:, 0].shape)
    tangent = np.stack([np.cos(slope), -np.sin(slope)], axis=1)
    if not scene.moves_in_plane:
        path = np.sum((position - origin[..., None]) * tangent, axis=1)
        speed = np.sum(velocity * tangent, axis=1)
    else:
        speed = np.linalg.norm(velocity, axis=1)
        steps = np.linalg.norm(np.diff(position, axis=-1), axis=1)
        path = np.pad(np.cumsum(steps, axis=-1), [(0, 0), (1, 0)])
    return np.arange(path.shape[-1]) * model.record_dt_s, path, speed
