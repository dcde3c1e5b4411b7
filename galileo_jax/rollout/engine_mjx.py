"""The MJX engine: the same rollouts in pure JAX, on a GPU or, slowly, on a CPU."""

import contextlib
import io
import os
from concurrent.futures import ThreadPoolExecutor
from functools import cached_property

import jax
import jax.numpy as jnp
import numpy as np

from galileo_jax.model.model import SUBSTEPS, Model
from galileo_jax.rollout.motion import dynamics, state_at
from galileo_jax.rollout.mujoco_fields import (
    Fields,
    finite,
    make_fields,
    make_loads,
    rigid_motion,
    sliding_objects,
    to_path,
)

# Without the two lines that it prints where NVIDIA Warp is not installed.
with contextlib.redirect_stdout(io.StringIO()), contextlib.redirect_stderr(io.StringIO()):
    from mujoco import mjx

# Larger batches are slower per rollout on a CPU; a GPU wants to be filled.
BATCH_CPU, BATCH_GPU = 8, 256


class EngineMJX:
    """Simulates batches of parameter vectors in MJX; compiled once for one batch size."""

    name = "mjx"

    def __init__(self, model: Model):
        self.model = model
        self._base = mjx.put_model(model.scene.model)
        self.is_on_cpu = jax.default_backend() == "cpu"
        self.batch = BATCH_CPU if self.is_on_cpu else BATCH_GPU

    def simulate(self, theta: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """As `EngineC.simulate`; NaN where the parameters are not finite."""
        usable, is_good = finite(theta)
        missing = -len(usable) % self.batch
        padded = np.concatenate([usable, np.repeat(usable[:1], missing, axis=0)])
        parts = padded.reshape(-1, self.batch, padded.shape[1])
        # XLA runs one small rollout on one core; threads give the others theirs.
        workers = (os.cpu_count() or 1) if self.is_on_cpu else 1
        compiled, is_64_bit = self._compiled, jax.config.read("jax_enable_x64")

        def run(part: np.ndarray) -> tuple[jax.Array, jax.Array]:
            with jax.enable_x64(is_64_bit):  # the setting may be the calling thread's own
                return jax.block_until_ready(compiled(part))

        with ThreadPoolExecutor(workers) as pool:
            done = list(pool.map(run, parts))
        position = np.concatenate([np.asarray(p) for p, _ in done])[: len(theta)]
        velocity = np.concatenate([np.asarray(v) for _, v in done])[: len(theta)]
        position, velocity = position.astype(float), velocity.astype(float)
        position[~is_good] = np.nan
        velocity[~is_good] = np.nan
        return position, velocity

    @cached_property
    def _compiled(self):
        parameters = jax.ShapeDtypeStruct((self.batch, len(self.model.names)), jnp.zeros(()).dtype)
        return jax.jit(jax.vmap(self.rollout)).lower(parameters).compile()

    def rollout(self, theta: jax.Array) -> tuple[jax.Array, jax.Array]:
        """One rollout in pure JAX: `[parameter]` to two arrays `[object, 2, record + 1]`."""
        compiled = self.model.scene.model
        effects = self.model.effects + self.model.nuisances
        scene, named = self.model.scene.surroundings, self.model.by_name(theta)
        law = dynamics(effects, scene, named, jnp)
        loads = make_loads(effects, scene, named, law)
        fields = make_fields(law, scene, jnp)
        model = self._with(fields)
        data = mjx.make_data(compiled).replace(qpos=fields.qpos, qvel=fields.qvel)
        home = jnp.asarray(compiled.body_pos[1:][:, [0, 2]])
        dt = float(compiled.opt.timestep)

        def look(data):
            return data.qpos.reshape(home.shape) + home, data.qvel.reshape(home.shape)

        def record(data, index):
            position, velocity = look(data)
            path, speed = to_path(position, velocity, scene)
            state = state_at(path, speed, index * SUBSTEPS * dt, scene)
            rubbed = model
            if loads.force is not None:
                data = data.replace(qfrc_applied=loads.force(state))
            if loads.friction is not None:
                friction = self._rub(loads.friction(state))
                rubbed = model.tree_replace({"pair_friction": friction})
            data = jax.lax.fori_loop(0, SUBSTEPS, lambda _, d: mjx.step(rubbed, d), data)
            return data, (position, velocity)

        last, (positions, velocities) = jax.lax.scan(
            record, data, jnp.arange(self.model.num_records)
        )
        position, velocity = look(last)
        positions = jnp.concatenate([positions, position[None]])
        velocities = jnp.concatenate([velocities, velocity[None]])
        path, speed = rigid_motion(positions - 0.5 * dt * velocities, velocities, law, scene)
        return jnp.moveaxis(path, 0, -1), jnp.moveaxis(speed, 0, -1)

    def _with(self, fields: Fields):
        """The MJX model with one rollout's masses, frictions and bumpers.

        A mass is more than `body_mass`: contacts are scaled by the inverse weights that
        `mj_setConst` derives from it. With slide joints only, each scales with 1 / mass.
        """
        compiled, base = self.model.scene.model, self._base
        ratio = fields.mass / compiled.body_mass[1:]
        per_body = jnp.concatenate([jnp.ones(1), ratio])
        per_dof = jnp.repeat(ratio, 2)
        hits = np.delete(np.arange(compiled.npair), sliding_objects(compiled)[0])
        return base.tree_replace(
            {
                "body_mass": base.body_mass * per_body,
                "body_subtreemass": base.body_subtreemass * per_body.at[0].set(ratio.mean()),
                "body_inertia": base.body_inertia * per_body[:, None],
                "body_invweight0": base.body_invweight0 / per_body[:, None],
                "dof_invweight0": base.dof_invweight0 / per_dof,
                "pair_friction": self._rub(fields.friction),
                "pair_solref": base.pair_solref.at[hits].set(fields.bumper),
            }
        )

    def _rub(self, friction: jax.Array | np.ndarray) -> jax.Array:
        """The contact pairs' friction with the objects' coefficients `[object]` in it."""
        sleds, objects = sliding_objects(self.model.scene.model)
        return self._base.pair_friction.at[sleds, :2].set(friction[objects, None])
