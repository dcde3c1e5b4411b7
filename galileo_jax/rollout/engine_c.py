"""The C engine: MuJoCo's own batch of simulations, stepped on all cores."""

from functools import lru_cache

import numpy as np
from mujoco.batch import Batch

from galileo_jax.model.model import SUBSTEPS, Model
from galileo_jax.rollout.motion import dynamics, state_at
from galileo_jax.rollout.mujoco_fields import (
    Fields,
    finite,
    make_fields,
    make_loads,
    rigid_motion,
    to_path,
    write_contacts,
)

# Slower than this and no longer changing: at rest (contacts creep at 0.2 mm/s).
REST_SPEED_M_S, REST_CHANGE_M_S = 1e-3, 1e-5
LOOK_EVERY = 8  # recorded steps between looks whether all is at rest


class EngineC:
    """Simulates batches of parameter vectors.

    A batch stops once all in it are at rest; until then those at rest creep (0.2 mm/s on a
    ramp), so that a result depends on its batch by no more than that.
    """

    name = "c"

    def __init__(self, model: Model):
        self.model = model
        self._batch = lru_cache(maxsize=4)(self.new_batch)

    def new_batch(self, size: int) -> Batch:
        """Simulations of the scene, to be written and stepped."""
        return Batch(self.model.scene.model, nsim=size)

    def simulate(self, theta: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Centres (m) and velocities (m/s), each `[batch, object, 2, record + 1]`.

        Every `record_dt_s` from the release on, of `theta` `[batch, parameter]`. Entries of a
        rollout with non-finite parameters or one that MuJoCo gave up are NaN.
        """
        usable, is_good = finite(theta)
        model, scene = self.model, self.model.scene.surroundings
        named = model.by_name(usable)
        law = dynamics(model.effects + model.nuisances, scene, named, np)
        loads = make_loads(model.effects + model.nuisances, scene, named, law)
        batch = self._batch(len(theta))
        self.write(batch, make_fields(law, scene, np))
        qpos, qvel = batch.bind("qpos"), batch.bind("qvel")
        applied = batch.bind("qfrc_applied")
        home = model.scene.model.body_pos[1:][:, [0, 2]]
        shape = (len(theta), len(home), 2)
        positions = np.empty((model.num_records + 1, *shape))
        velocities = np.empty_like(positions)
        dt = float(model.scene.model.opt.timestep)
        for record in range(len(positions)):
            np.add(qpos.reshape(shape), home, out=positions[record])
            velocities[record] = qvel.reshape(shape)
            is_look = loads.is_steady and record and record % LOOK_EVERY == 0
            if is_look and is_at_rest(velocities[record - 1 :]):
                positions[record:] = positions[record]
                velocities[record:] = 0.0
                break
            if record == len(positions) - 1:
                break
            time_s = record * SUBSTEPS * dt
            path, speed = to_path(positions[record], velocities[record], scene)
            state = state_at(path, speed, np.asarray(time_s), scene)
            if loads.force is not None:
                applied[:] = loads.force(state)
            if loads.friction is not None:
                write_contacts(batch, model.scene.model, loads.friction(state), None)
            batch.step(nstep=SUBSTEPS)
        # Semi-implicit Euler is second order in x - dt v / 2 (leapfrog), first order in x.
        positions -= 0.5 * dt * velocities
        if batch.warning.any() or not np.isfinite(positions).all():
            is_good &= ~batch.warning.reshape(len(theta), -1).any(axis=1)
        path, speed = rigid_motion(positions, velocities, law, scene)
        path[:, ~is_good] = np.nan
        speed[:, ~is_good] = np.nan
        return np.moveaxis(path, 0, -1), np.moveaxis(speed, 0, -1)

    def write(self, batch: Batch, fields: Fields) -> None:
        """Writes masses, frictions and the start into the batch."""
        compiled = self.model.scene.model
        batch.state[:] = 0.0
        mass, inertia = batch.expand("body_mass"), batch.expand("body_inertia")
        mass[:, 1:] = fields.mass
        inertia[:, 1:] = (
            compiled.body_inertia[1:] * (fields.mass / compiled.body_mass[1:])[..., None]
        )
        write_contacts(batch, compiled, fields.friction, fields.bumper)
        batch.set_const()
        batch.bind("qpos")[:] = fields.qpos
        batch.bind("qvel")[:] = fields.qvel
        batch.warning[...] = 0


def is_at_rest(velocities: np.ndarray) -> bool:
    """Whether two records on end, `[2, ...]` and more, show nothing that moves or starts to."""
    before, now = velocities[0], velocities[1]
    return bool(np.abs(now).max() < REST_SPEED_M_S and np.abs(now - before).max() < REST_CHANGE_M_S)
