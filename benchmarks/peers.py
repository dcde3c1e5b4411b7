"""mujoco.sysid on the tracks of `samplers`.

Its optimiser is mujoco.minimize.least_squares; it gets a plain mujoco.batch of the scene with m1,
k1, m2, k2 free, 256 random starts and the best three refined, without which it is stuck in nine of
ten cases.
"""

import io
import math
from collections.abc import Callable
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from galileo_jax.inference.problem import Problem
from galileo_jax.model.model import Model
from galileo_jax.rollout.engine_c import EngineC
from galileo_jax.rollout.motion import dynamics
from galileo_jax.rollout.mujoco_fields import make_fields, rigid_motion

MAIN = ("m1", "k1", "m2", "k2")
STEP_S = 1 / 480  # agrees with g (sin - k cos) to 0.2 %, and is what others take
NUM_STARTS, NUM_REFINED = 256, 3
LOW, HIGH = np.array([0.05, 0.005, 0.05, 0.005]), np.array([1.5, 0.6, 1.5, 0.6])
START_LOW, START_HIGH = np.array([0.1, 0.02, 0.1, 0.02]), np.array([1.0, 0.35, 1.0, 0.35])
SUFFICIENT = 1.5  # chi2 per value with which a refined start counts as converged


class Estimate(NamedTuple):
    """What a peer says."""

    values: np.ndarray  # `[4]`, in the order of `MAIN`
    entries: dict[str, dict[str, Any]]  # k1, k2 and mass_ratio as in result.json
    centres_m: np.ndarray  # `[object, 2, frame]`, of its own rollout at `values`
    num_rollouts: int  # it took
    is_converged: bool  # by its own account


def sysid(problem: Problem, noise_m_s: float, seed: int) -> Estimate:
    """mujoco.sysid, multi-start; intervals by its formula, s^2 (J^T J)^-1."""
    from mujoco import minimize

    roll_out = _mujoco(problem)
    observed = problem.observation.velocity_m_s
    dt = np.diff(problem.observation.times_s)
    count = 0

    def residuals(x: np.ndarray) -> np.ndarray:
        """`[4, batch]` to `[value, batch]`, as mujoco.minimize has it."""
        nonlocal count
        x = x.reshape(len(MAIN), -1)
        count += x.shape[1]
        velocity = np.diff(roll_out(x.T), axis=-1) / dt
        return ((velocity - observed) / noise_m_s).reshape(x.shape[1], -1).T.copy()

    rng = np.random.default_rng(seed)
    starts = rng.uniform(START_LOW, START_HIGH, (NUM_STARTS, len(MAIN)))
    cost = (residuals(starts.T) ** 2).mean(axis=0)
    refined = []
    for i in np.argsort(cost)[:NUM_REFINED]:
        x, log = minimize.least_squares(
            starts[i],
            residuals,
            [LOW, HIGH],
            eps=1e-3,
            verbose=minimize.Verbosity.FULLITER,
            output=io.StringIO(),
        )
        refined.append((float(np.mean(np.asarray(log[-1].residual) ** 2)), np.ravel(x), log[-1]))
    chi2, x, last = min(refined, key=lambda entry: entry[0])
    sd = _sysid_sd(x, np.asarray(last.jacobian), np.ravel(last.residual))
    return Estimate(x, _intervals(x, sd), roll_out(x[None])[0], count, chi2 <= SUFFICIENT)


def point(x: np.ndarray) -> dict[str, dict[str, Any]]:
    """`[4]` without an interval."""
    m1, k1, m2, k2 = map(float, x)
    values = {"k1": k1, "k2": k2, "mass_ratio": m1 / m2}
    return {name: {"mean": value, "identified": True} for name, value in values.items()}


def _mujoco(problem: Problem) -> Callable[[np.ndarray], np.ndarray]:
    """`[batch, 4]` to centres `[batch, object, 2, frame]`: MuJoCo alone, without nuisances."""
    scene = problem.model.scene
    plain = replace(scene, timestep_s=STEP_S)
    engine = EngineC(Model(plain, problem.model.duration_s, nuisances=()))
    surroundings, names = scene.surroundings, engine.model.names
    steps = round(float(np.diff(problem.observation.times_s)[0]) / STEP_S)
    home = plain.model.body_pos[1:][:, [0, 2]]

    def roll_out(theta: np.ndarray) -> np.ndarray:
        law = dynamics((), surroundings, dict(zip(names, theta.T, strict=True)), np)
        batch = engine.new_batch(len(theta))
        engine.write(batch, make_fields(law, surroundings, np))
        shape = (len(problem.observation.times_s), len(theta), *home.shape)
        position, velocity = np.empty(shape), np.empty(shape)
        for frame in range(len(position)):
            if frame:
                batch.step(nstep=steps)
            position[frame] = batch.bind("qpos").reshape(shape[1:]) + home
            velocity[frame] = batch.bind("qvel").reshape(shape[1:])
        position -= 0.5 * STEP_S * velocity
        return np.moveaxis(rigid_motion(position, velocity, law, surroundings)[0], 0, -1)

    return roll_out


def _sysid_sd(x: np.ndarray, jacobian: np.ndarray, white: np.ndarray) -> np.ndarray:
    """Of log(m1 / m2), k1 and k2 at a given m1 m2: the column of the masses' size is null."""
    m1, _, m2, _ = x
    turn = np.zeros((4, 3))
    turn[0, 0], turn[2, 0], turn[1, 1], turn[3, 2] = m1 / 2, -m2 / 2, 1.0, 1.0
    turned = jacobian @ turn
    variance = white @ white / (white.size - turn.shape[1])
    return np.sqrt(variance * np.diag(np.linalg.pinv(turned.T @ turned)))


def _intervals(x: np.ndarray, sd: np.ndarray) -> dict[str, dict[str, Any]]:
    m1, k1, m2, k2 = map(float, x)
    ratio, (log_sd, k1_sd, k2_sd) = m1 / m2, map(float, sd)
    factor = math.exp(min(1.96 * log_sd, 50.0))
    spans = {
        "k1": (k1, k1 - 1.96 * k1_sd, k1 + 1.96 * k1_sd, k1_sd),
        "k2": (k2, k2 - 1.96 * k2_sd, k2 + 1.96 * k2_sd, k2_sd),
        "mass_ratio": (ratio, ratio / factor, ratio * factor, ratio * log_sd),
    }
    return {
        name: {"mean": mean, "q025": low, "q975": high, "sd": spread, "identified": True}
        for name, (mean, low, high, spread) in spans.items()
    }
