"""The C engine with bodies that move freely: they turn, tip and leave the line of travel.

Until two objects meet nothing makes them leave the plane: so far the rigid engine moves them,
through the foot and with all its effects. From the instant of the first hit on they are MuJoCo's,
with free joints and their true shapes, flat on the table: its steps begin with the hit, so that
the motion does not depend on where in a step that falls. Effects act at the centres, along the
travel, and through the friction coefficients, as in `engine_c`; faces are smooth. A clip shows a
centre's x and y; how the bodies turn stands in `Poses`.
"""

# mujoco's classes live in a compiled module without stubs.
# pyright: reportAttributeAccessIssue=false

from functools import lru_cache

import mujoco
import numpy as np
from mujoco.batch import Batch

from galileo_jax.model.model import Model
from galileo_jax.model.scene.free_scene import free_model
from galileo_jax.rollout.engine_c import LOOK_EVERY, is_at_rest
from galileo_jax.rollout.engine_path import EnginePath
from galileo_jax.rollout.events import reaches_s
from galileo_jax.rollout.free_start import (
    Poses,
    as_seen,
    between_records,
    check_free,
    in_space,
    past_the_foot_m,
    record_before_hit,
)
from galileo_jax.rollout.motion import Dynamics, dynamics, state_at
from galileo_jax.rollout.mujoco_fields import Faces, Loads, finite, make_loads, write_contacts

# Box contacts and the faces' damping are stable at it; halving it changes hardly anything.
STEP_S = 1 / 3840
SETTLE_S = 0.5
ALONG, ACROSS, UP = 0, 1, 2  # MuJoCo's axes; ACROSS points away from the camera
# Of two cubes that meet squarely, at 0.2 and 1.7 m/s.
FACES = Faces(
    np.array([0.0, 0.008, 0.030, 0.065, 0.104, 0.181, 0.316, 0.440, 0.645, 0.797, 0.891, 0.954]),
    np.array([300.0, 1e5, *[4e5] * 10]),
    np.array([*[3e3] * 3, 2e3, 1.5e3, 1e3, 600.0, 400.0, 200.0, 100.0, 50.0, 20.0]),
)


class EngineCFree:
    """Simulates batches of parameter vectors; as `EngineC`, with six coordinates per body."""

    name = "c"

    def __init__(self, model: Model):
        """Compiles the scene.

        Raises:
          InputError: no two objects can meet on the table, or they meet at the foot.
        """
        check_free(model)
        self.model = model
        self._planar = EnginePath(model)
        self.substeps = max(1, round(model.record_dt_s / STEP_S))
        self.compiled = free_model(model.scene, model.record_dt_s / self.substeps)
        self._sunk_m = _sunk_m(self.compiled)
        self._batch = lru_cache(maxsize=4)(lambda size: Batch(self.compiled, nsim=size))

    def simulate(self, theta: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """As `EngineC.simulate`: centres and velocities `[batch, object, 2, record + 1]`."""
        poses = self.poses(theta)
        return poses.position_m[:, :, :2], poses.velocity_m_s[:, :, :2]

    def poses(self, theta: np.ndarray) -> Poses:
        """Where parameters `[batch, parameter]` take the objects, and how they turn them.

        Entries of a rollout with non-finite parameters, one that MuJoCo gave up or one whose
        objects meet while the first still crosses the foot are NaN.
        """
        usable, is_good = finite(theta)
        model, scene = self.model, self.model.scene.surroundings
        effects, named = model.effects + model.nuisances, model.by_name(usable)
        law = dynamics(effects, scene, named, np)
        place, speed = (np.asarray(values, float) for values in self._planar.simulate(usable))
        poses = in_space(place, speed, np.asarray(model.scene.z_m))
        begin = record_before_hit(place, speed, scene, model.record_dt_s)
        if begin.min() < poses.position_m.shape[-1]:
            law = law._replace(foot=np.ones_like(law.foot))  # what it did is done
            is_good &= self._is_flat(poses, begin)
            is_good &= self._go_on(poses, begin, law, make_loads(effects, scene, named, law))
        for values in poses:
            values[~is_good] = np.nan
        return poses

    def _is_flat(self, poses: Poses, begin: np.ndarray) -> np.ndarray:
        """Whether all of object 1 is on the table when MuJoCo takes over, `[batch]`."""
        last = np.minimum(begin, poses.position_m.shape[-1] - 1)
        x = poses.position_m[np.arange(len(begin)), 0, 0, last]
        return (begin > last) | (x >= past_the_foot_m(self.model.scene.surroundings))

    def _go_on(self, poses: Poses, begin: np.ndarray, law: Dynamics, loads: Loads) -> np.ndarray:
        """Writes the motion from the hits on into `poses`; returns which rollouts were kept.

        Rollouts are stepped side by side; one that has not come so far is held at its hit, and
        each is `late` by a time of its own, until it is put back on the records' clock. (Forces
        that depend on the time are early by that: a record and a half at most.)
        """
        model, scene = self.model, self.model.scene.surroundings
        size, count, _, num_records = poses.position_m.shape
        batch = self._batch(size)
        self._write(batch, law)
        places = batch.bind("qpos").reshape(size, count, 7)
        speeds = batch.bind("qvel").reshape(size, count, 6)
        forces = batch.bind("qfrc_applied").reshape(size, count, 6)
        *first, late_s = self._first(poses, np.minimum(begin, num_records - 1), law)
        after = Poses(*(values.copy() for values in poses))
        dt, corner = float(self.compiled.opt.timestep), np.asarray(scene.corner_m)
        before = np.full_like(speeds, np.inf)
        for record in range(int(begin.min()), num_records):
            waits = begin >= record
            places[waits], speeds[waits] = first[0][waits], first[1][waits]
            # Semi-implicit Euler is second order in x - dt v / 2 (leapfrog), first order in x.
            centre = places[..., :3] - 0.5 * dt * speeds[..., :3]
            lifted = centre.copy()
            lifted[..., UP] += self._sunk_m
            seen = as_seen(lifted, speeds[..., :3], law.table_rad, scene)
            for values, now in zip(after, (*seen, places[..., 3:]), strict=True):
                values[..., record] = now
            if record == num_records - 1:
                break
            is_look = loads.is_steady and record % LOOK_EVERY == 0
            if is_look and not waits.any() and is_at_rest(np.stack([before, speeds])):
                for values in after:
                    values[..., record + 1 :] = values[..., record, None]
                after.velocity_m_s[..., record + 1 :] = 0.0
                break
            before = speeds.copy()
            path, along = centre[..., ALONG] - corner, np.array(speeds[..., ALONG])
            time_s = np.asarray(record * model.record_dt_s)
            state = state_at(np.maximum(path, 0.0), along, time_s, scene)
            if loads.force is not None:
                forces[..., [ALONG, UP]] = loads.force(state).reshape(size, count, 2)
            if loads.friction is not None:
                write_contacts(batch, self.compiled, loads.friction(state), None)
            batch.step(nstep=self.substeps)
        for i in np.flatnonzero(begin < num_records - 1):
            own, mujocos = ([values[i] for values in some] for some in (poses, after))
            _join(Poses(*own), Poses(*mujocos), int(begin[i]), late_s[i] / model.record_dt_s, model)
        return ~batch.warning.reshape(size, -1).any(axis=1)

    def _first(
        self, poses: Poses, begin: np.ndarray, law: Dynamics
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """MuJoCo's places and speeds at the hit, and how long after the record `begin` it is.

        All are flat, and sunk in as at rest.
        """
        rows, (size, count) = np.arange(len(begin)), law.inertia.shape
        cos = np.cos(law.table_rad)[:, None]
        corner = np.asarray(self.model.scene.surroundings.corner_m)
        places = np.tile(self.compiled.qpos0.reshape(count, 7), (size, 1, 1))
        speeds = np.zeros((size, count, 6))
        x, v = (values[rows, :, 0, begin] for values in (poses.position_m, poses.velocity_m_s))
        earlier = poses.velocity_m_s[rows, :, 0, np.maximum(begin - 1, 0)]
        a = (v - earlier) / self.model.record_dt_s
        late_s = self._hit_s(x, v, a)[:, None]
        v_hit = (v + a * late_s) / cos
        path = (x + v * late_s + 0.5 * a * late_s**2 - corner) / cos
        speeds[..., ALONG] = v_hit
        places[..., ALONG] = corner + path + 0.5 * self.compiled.opt.timestep * v_hit
        places[..., UP] -= self._sunk_m
        return places, speeds, late_s[:, 0]

    def _hit_s(self, x: np.ndarray, v: np.ndarray, a: np.ndarray) -> np.ndarray:
        """When the first faces meet, from `[batch, object]`; 0 where none are about to."""
        half = np.asarray(self.model.scene.surroundings.half_length_m)
        gap = np.diff(x, axis=1) - half[1:] - half[:-1]
        closing, faster = -np.diff(v, axis=1), -np.diff(a, axis=1)
        times = np.where(closing > 0, reaches_s(gap, closing, faster), np.inf)
        soonest = np.min(times, axis=1)
        return np.where(soonest < 2 * self.model.record_dt_s, soonest, 0.0)

    def _write(self, batch: Batch, law: Dynamics) -> None:
        """Writes masses, frictions and faces into the batch."""
        compiled, inertia = self.compiled, law.inertia[..., None]
        batch.state[:] = 0.0
        batch.expand("body_mass")[:, 1:] = law.inertia
        share = inertia / compiled.body_mass[1:, None]
        batch.expand("body_inertia")[:, 1:] = compiled.body_inertia[1:] * share
        write_contacts(batch, compiled, law.friction, FACES.solref(law.restitution, np))
        batch.bind("qpos")[:] = compiled.qpos0
        batch.set_const()
        batch.warning[...] = 0


def _join(planar: Poses, after: Poses, begin: int, late: float, model: Model) -> None:
    """Puts one rollout's motion after its hit, which is `late` records, where it belongs."""
    records = np.arange(begin + int(np.ceil(late)), planar.position_m.shape[-1])
    found = between_records(after, records - late, model.record_dt_s)
    for values, new in zip(planar, found, strict=True):
        values[..., records] = new


def _sunk_m(compiled: mujoco.MjModel) -> np.ndarray:
    """How far the contacts give way under each object at rest, `[object]`, whatever its mass."""
    data = mujoco.MjData(compiled)
    apart = data.qpos.reshape(-1, 7)
    apart[:, ALONG] = 10.0 + 10.0 * np.arange(len(apart))  # off the ramp and off each other
    for _ in range(round(SETTLE_S / compiled.opt.timestep)):
        mujoco.mj_step(compiled, data)
    return compiled.qpos0.reshape(-1, 7)[:, UP] - data.qpos.reshape(-1, 7)[:, UP]
