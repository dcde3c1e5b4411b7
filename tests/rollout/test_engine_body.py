"""The body engine: conservation laws, closed forms, slopes, and MuJoCo's C engine."""

import math
from typing import Any

import jax
import jax.numpy as jnp
import mujoco as mujoco_stubs
import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.spatial.transform import Rotation

from galileo_jax.rollout.body import Pose, Solid, box, energy_j_kg, gaps_m, spin_rad_s, thrown
from galileo_jax.rollout.engine_body import roll_out, roll_out_batch, substeps_for
from tests.precision import in_64_bit

mujoco: Any = mujoco_stubs  # its stubs lack what is used here
EDGE_M, G, FPS = 0.1048, 9.81, 148.0
FRAMES = 80
STEPS_S = np.full(FRAMES, 1 / FPS)
TURNED = np.array([0.3, 0.5, 0.2, 0.7])
SOFT_M = 0.002  # MuJoCo's contacts give way, and its impacts take a few steps


@pytest.fixture(autouse=True)
def precision():
    with in_64_bit():
        yield


def cube(friction=0.18, restitution=0.125, gravity=G, size=(EDGE_M,) * 3, round_m=0.0) -> Solid:
    numbers = (jnp.asarray(value) for value in (friction, restitution, gravity, 0.0))
    return box(jnp.array(size), *numbers, round_m)  # pyright: ignore[reportCallIssue]


def start(solid, height=0.15, quaternion=TURNED, velocity=(1.0, 0.2, 0.5), spin=(3.0, -5.0, 4.0)):
    place = jnp.array([0.0, 0.0, height])
    return thrown(solid, place, jnp.asarray(quaternion), jnp.array(velocity), jnp.array(spin))


def rolled(solid: Solid, pose: Pose, steps_s=STEPS_S, substeps=4) -> Pose:
    one = jax.tree.map(lambda value: jnp.asarray(value)[None], (solid, pose, steps_s))
    return jax.tree.map(lambda value: value[0], roll_out_batch(*one, substeps=substeps))


def of_all(function, solid: Solid, poses: Pose) -> np.ndarray:
    return np.asarray(jax.vmap(lambda pose: function(solid, pose))(poses))


@pytest.mark.parametrize("size", [(EDGE_M,) * 3, (0.05, 0.1, 0.2)], ids=["cube", "box"])
def test_flight_keeps_energy_and_angular_momentum(size):
    """A box's spin wanders about, as a cube's does not; SciPy's solution of Euler's equations."""
    solid = cube(size=size)
    pose = start(solid, height=5.0)
    poses = rolled(solid, pose)
    energy = of_all(energy_j_kg, solid, poses)
    assert energy == pytest.approx(energy[0], rel=1e-10)
    assert np.ptp(poses.momentum_m2_s, axis=0) == pytest.approx(0.0, abs=1e-15)
    times = np.append(0.0, np.cumsum(STEPS_S))
    falls = 5.0 + 0.5 * times - G * times**2 / 2
    assert np.asarray(poses.position_m[:, 2]) == pytest.approx(falls, abs=1e-12)
    inertia = np.asarray(solid.inertia_m2)

    def euler(_: float, y: np.ndarray) -> np.ndarray:
        q, w = y[:4], y[4:]
        turn = 0.5 * np.append(-q[1:] @ w, q[0] * w + np.cross(q[1:], w))
        return np.append(turn, np.cross(inertia * w, w) / inertia)

    first = np.asarray(pose.quaternion)
    own = Rotation.from_quat(first, scalar_first=True).inv().apply([3.0, -5.0, 4.0])
    found = solve_ivp(euler, (0, times[-1]), [*first, *own], t_eval=times, rtol=1e-12, atol=1e-13)
    assert np.asarray(poses.quaternion) == pytest.approx(found.y[:4].T, abs=1e-9)


def test_an_impact_at_a_corner_is_newtons_and_coulombs():
    """Straight down onto one corner below the centre: nothing turns, e of the speed is left."""
    up = Rotation.align_vectors([[0, 0, 1]], [[1, 1, 1]])[0].as_quat(scalar_first=True)
    solid = cube(restitution=0.4)
    height = 0.1
    half = EDGE_M / 2 * math.sqrt(3)
    poses = rolled(solid, start(solid, half + height, up, (0, 0, 0), (0, 0, 0)))
    times = np.append(0.0, np.cumsum(STEPS_S))
    hit = math.sqrt(2 * height / G)
    after = times - hit
    bounced = 0.4 * G * hit * after - G * after**2 / 2
    flies = (after > 0) & (bounced > 0)
    assert np.asarray(poses.position_m[flies, 2]) == pytest.approx(half + bounced[flies], abs=1e-8)


def test_impulses_stay_in_the_cone_and_take_energy():
    """Of many tosses: energy never grows, and nothing sinks in by more than a rounding."""
    rng = np.random.default_rng(3)
    solid = cube()
    count = 24
    poses = [
        start(solid, 0.12, rng.normal(size=4), rng.normal(0, 1, 3), rng.normal(0, 8, 3))
        for _ in range(count)
    ]
    together = jax.tree.map(lambda *values: jnp.stack(values), *poses)
    solids = jax.tree.map(lambda value: jnp.stack([value] * count), solid)
    found = roll_out_batch(solids, together, jnp.asarray(np.tile(STEPS_S, (count, 1))))
    each = [jax.tree.map(lambda value, i=i: value[i], found) for i in range(count)]
    energy = np.array([of_all(energy_j_kg, solid, one) for one in each])
    gaps = np.array([of_all(gaps_m, solid, one).min(axis=1) for one in each])
    assert np.isfinite(energy).all()
    assert np.diff(energy, axis=1).max() < 1e-4
    assert gaps.min() > -1e-4
    alone = rolled(solid, poses[5])
    assert np.asarray(alone.position_m) == pytest.approx(np.asarray(found.position_m[5]), abs=1e-9)


@pytest.mark.parametrize("round_m", [0.0, 0.003])
def test_a_face_slides_to_rest(round_m):
    """With a = mu g, to v^2 / (2 mu g), and stays there."""
    solid = cube(round_m=round_m)
    speed = 0.5
    pose = start(solid, EDGE_M / 2, np.array([1.0, 0, 0, 0]), (speed, 0, 0), (0, 0, 0))
    poses = rolled(solid, pose)
    times = np.append(0.0, np.cumsum(STEPS_S))
    until = np.minimum(times, speed / (0.18 * G))
    way = speed * until - 0.18 * G * until**2 / 2
    assert np.asarray(poses.position_m[:, 0]) == pytest.approx(way, abs=2e-6)
    assert np.asarray(poses.position_m[:, 2]) == pytest.approx(EDGE_M / 2, abs=1e-6)
    assert np.asarray(poses.velocity_m_s[-1]) == pytest.approx(0.0, abs=1e-8)


def test_it_rolls_over_an_edge():
    """On a rough plane a tilted cube is a pendulum about its edge; half the step, a quarter off."""
    solid = cube(friction=5.0, restitution=0.0)
    lean = 0.2  # from standing on the edge
    corner = EDGE_M / math.sqrt(2)
    turned = [math.cos((math.pi / 4 + lean) / 2), 0.0, math.sin((math.pi / 4 + lean) / 2), 0.0]
    pose = start(solid, corner * math.cos(lean), np.array(turned), (0, 0, 0), (0, 0, 0))
    share = EDGE_M**2 / 6 + corner**2  # of the moment of inertia about the edge

    def fall(_: float, y: np.ndarray) -> list[float]:
        return [y[1], G * corner * math.sin(y[0]) / share]

    errors = []
    for finer in (1, 2):
        times = np.append(0.0, np.cumsum(STEPS_S)) / finer
        exact = solve_ivp(fall, (0, 0.09), [lean, 0], dense_output=True, rtol=1e-10, atol=1e-12)
        high = np.asarray(rolled(solid, pose, STEPS_S / finer).position_m[:, 2])
        inside = times < 0.09
        errors.append(np.abs(high - corner * np.cos(exact.sol(times)[0]))[inside].max())
    assert errors[0] < 2e-5
    assert errors[1] < 0.4 * errors[0]


def test_slopes_are_those_of_differences():
    """Through two impacts and a slide, with respect to the start and all parameters."""
    pose = start(cube(), 0.11, velocity=(1.0, 0.2, -0.5))

    def motion(values: jax.Array) -> jax.Array:
        solid = box(jnp.full(3, values[0]), values[1], values[2], values[3], values[4])
        first = pose._replace(velocity_m_s=pose.velocity_m_s.at[2].add(values[5]))
        poses = roll_out(solid, first, jnp.asarray(STEPS_S[:30]))
        return jnp.concatenate([poses.position_m, poses.quaternion], axis=1)

    at = jnp.array([EDGE_M, 0.18, 0.125, G, 0.0, 0.0])
    run = jax.jit(motion)
    slopes = jax.jit(jax.jacfwd(motion))(at)
    for i, step in enumerate([1e-7, 1e-6, 1e-6, 1e-5, 1e-7, 1e-6]):
        way = step * jnp.eye(len(at))[i]
        differences = (run(at + way) - run(at - way)) / (2 * step)
        size = 1 + jnp.abs(differences).max()
        assert float(jnp.abs(differences - slopes[..., i]).max() / size) < 1e-4, i
    assert float(jnp.abs(slopes[-1, :, 1]).max()) > 0.01


def test_mujoco_says_the_same():
    """From a throw over the first impact; from there bounces differ, contacts being soft there."""
    solid = cube(friction=0.18, restitution=0.0)
    pose = start(solid, 0.13, velocity=(0.6, 0.1, -0.5), spin=(2.0, -3.0, 1.0))
    poses = rolled(solid, pose)
    spec = f"""<mujoco><option timestep="5e-5" gravity="0 0 -{G}" cone="elliptic" impratio="100"/>
      <worldbody><geom type="plane" size="9 9 1" condim="3" friction="0.18 0 0"/>
      <body><freejoint/><geom type="box" size="{EDGE_M / 2} {EDGE_M / 2} {EDGE_M / 2}" mass="0.37"
      condim="3" friction="0.18 0 0" solref="0.0004 1.5"/></body></worldbody></mujoco>"""
    model = mujoco.MjModel.from_xml_string(spec)
    model.geom_solref[0] = [0.0004, 1.5]
    data = mujoco.MjData(model)
    turned = np.array(pose.quaternion)
    own = (
        Rotation.from_quat(turned, scalar_first=True).inv().apply(np.array(spin_rad_s(solid, pose)))
    )
    data.qpos = [*np.asarray(pose.position_m), *turned]
    data.qvel = [*np.asarray(pose.velocity_m_s), *own]
    places = [np.array(data.qpos[:3])]
    for frame in range(1, FRAMES + 1):
        while data.time < frame / FPS - 2.5e-5:
            mujoco.mj_step(model, data)
        places.append(np.array(data.qpos[:3]))
    apart = np.abs(np.asarray(poses.position_m) - places).max(axis=1)
    hit = int(np.argmax(of_all(gaps_m, solid, poses).min(axis=1) < 1e-3))
    assert apart[: hit + 10].max() < SOFT_M, apart
    assert 3 < hit < 30


def test_steps_are_short_enough():
    assert substeps_for(1 / 148) == 4
    assert substeps_for(1 / 1000) == 1
