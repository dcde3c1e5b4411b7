"""The body engine: conservation laws, closed forms, slopes, and MuJoCo's C engine."""

import functools
import math
from typing import Any

import jax
import jax.numpy as jnp
import mujoco as mujoco_stubs
import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.spatial.transform import Rotation

from galileo_jax.rollout import engine_body
from galileo_jax.rollout.body import (
    Pose,
    Solid,
    box,
    climbs_m_s,
    gaps_m,
    levers_m,
    spin_rad_s,
    thrown,
)
from galileo_jax.rollout.engine_body import roll_out

mujoco: Any = mujoco_stubs  # its stubs lack what is used here
EDGE_M, G, FPS = 0.1048, 9.81, 148.0
FRAMES = 80
STEPS_S = np.full(FRAMES, 1 / FPS)
TURNED = np.array([0.3, 0.5, 0.2, 0.7])
PARTS_WITHIN = 0.015  # of an impulse, where slip turns or ends on the way: parts are finite
SOFT_M = 0.002  # MuJoCo's contacts give way, and its impacts take a few steps


@functools.partial(jax.jit, static_argnames=("substeps",))
def roll_out_batch(solid: Solid, start: Pose, steps_s: jax.Array, substeps: int = 4) -> Pose:
    return jax.vmap(functools.partial(roll_out, substeps=substeps))(solid, start, steps_s)


def energy_j_kg(solid: Solid, pose: Pose) -> jax.Array:
    """Kinetic and potential energy over the mass."""
    turning = pose.momentum_m2_s @ spin_rad_s(solid, pose)
    high = solid.gravity * (pose.position_m[2] - solid.floor_m)
    return 0.5 * (pose.velocity_m_s @ pose.velocity_m_s + turning) + high


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


def struck(solid: Solid, quaternion, velocity, spin) -> tuple[Pose, Pose, np.ndarray]:
    """Just before and just after the impact of the lowest corner(s), and their levers."""
    quaternion = np.asarray(quaternion) / np.linalg.norm(quaternion)
    lever = np.asarray(levers_m(solid, jnp.asarray(quaternion)))
    high = -lever[:, 2].min()
    before = start(solid, high, quaternion, velocity, spin)
    hits = jnp.asarray(lever[:, 2] < -high + 1e-9)
    after = engine_body._struck(before, solid, hits, jnp.argsort(lever[:, 2])[:4])
    return before, after, lever[np.asarray(hits)]


def corner_speed(solid: Solid, pose: Pose, lever: np.ndarray) -> np.ndarray:
    return np.asarray(pose.velocity_m_s) + np.cross(spin_rad_s(solid, pose), lever)


def response(solid: Solid, lever: np.ndarray) -> np.ndarray:
    """K of u -> u + K p, of a cube's corner and impulses over the mass."""
    x, y, z = lever
    skew = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.eye(3) - skew @ skew / float(solid.inertia_m2[0])


@pytest.mark.parametrize("restitution", [0.0, 0.3, 1.0])
def test_a_smooth_corner_gets_newtons_impulse(restitution):
    """p = -(1 + e) u_n / (n (1 + I^-1 (r x n) x r) n), upwards, wherever the corner goes."""
    solid = cube(friction=0.0, restitution=restitution)
    before, after, levers = struck(solid, TURNED, (0.7, 0.2, -1.1), (3.0, -5.0, 4.0))
    (lever,) = levers
    normal = np.array([0.0, 0.0, 1.0])
    turn = np.cross(lever, normal)
    share = 1 + turn @ turn / float(solid.inertia_m2[0])
    push = -(1 + restitution) * corner_speed(solid, before, lever)[2] / share * normal
    assert np.asarray(after.velocity_m_s - before.velocity_m_s) == pytest.approx(push, abs=1e-9)
    twist = np.asarray(after.momentum_m2_s - before.momentum_m2_s)
    assert twist == pytest.approx(np.cross(lever, push), abs=1e-9)
    if restitution == 1.0:
        energy = energy_j_kg(solid, before)
        assert float(energy_j_kg(solid, after)) == pytest.approx(float(energy), rel=1e-9)


@pytest.mark.parametrize(
    ("along", "spin", "friction"),
    [(3.0, 0.0, 0.18), (-3.0, 4.0, 0.3), (0.4, 0.0, 2.0), (0.1, 0.0, 0.35)],
    ids=["slips", "slips back", "sticks", "slips, then the other way"],
)
def test_a_corner_that_slips_along_a_line_is_coulombs(along, spin, friction):
    """In a plane: slip at -mu p_n, until it ends; then it sticks, or goes the other way."""
    solid = cube(friction=friction, restitution=0.3, size=(EDGE_M, 0, EDGE_M))
    solid = solid._replace(inertia_m2=jnp.full(3, EDGE_M**2 / 6))
    tilt = 0.9
    quaternion = np.array([math.cos(tilt / 2), 0.0, math.sin(tilt / 2), 0.0])
    before, after, levers = struck(solid, quaternion, (along, 0.0, -1.0), (0.0, spin, 0.0))
    lever = levers[0] * [1, 0, 1]
    k = response(solid, lever)
    u = corner_speed(solid, before, lever)
    rises, impulse = -0.3 * u[2], np.zeros(3)
    way = -np.sign(u[0])
    direction = np.array([friction * way, 0, 1])
    ends = -u[0] / (k @ direction)[0]  # p_n at which the slip ends
    whole = (rises - u[2]) / (k @ direction)[2]
    if turns := 0 < ends < whole:
        impulse += ends * direction
        u = u + k @ impulse
        stays = -k[0, 2] / k[0, 0]  # p_t / p_n that keeps it from slipping
        direction = np.array([np.clip(stays, -friction, friction), 0, 1])
        whole = (rises - u[2]) / (k @ direction)[2]
    impulse += whole * direction
    found = np.asarray(after.velocity_m_s - before.velocity_m_s)
    assert found == pytest.approx(impulse, abs=PARTS_WITHIN * impulse[2] if turns else 1e-7)
    assert corner_speed(solid, after, lever)[2] == pytest.approx(rises, abs=1e-7)


def test_slip_that_turns_during_an_impact_is_rubbed_along_its_way():
    """dp_t = -mu u_t / |u_t| dp_n all along (Darboux, Keller), not only at the end."""
    solid = cube(friction=0.17, restitution=0.26)
    before, after, levers = struck(solid, TURNED, (0.35, 0.45, -1.0), (3.0, -5.0, 4.0))
    (lever,) = levers
    k, first = response(solid, lever), corner_speed(solid, before, lever)

    def rub(_: float, p: np.ndarray) -> np.ndarray:
        u = first + k @ p
        return np.append(-0.17 * u[:2] / np.linalg.norm(u[:2]), 1.0)

    def done(_: float, p: np.ndarray) -> float:
        return (first + k @ p)[2] + 0.26 * first[2]

    done.terminal = True
    path = solve_ivp(rub, (0, 9), np.zeros(3), events=done, rtol=1e-10, atol=1e-12)
    exact = path.y[:, -1]
    last = first + k @ exact
    turned = math.acos(last[:2] @ first[:2] / np.linalg.norm(last[:2]) / np.linalg.norm(first[:2]))
    assert turned > 0.5  # so that it matters
    found = np.asarray(after.velocity_m_s - before.velocity_m_s)
    assert found == pytest.approx(exact, abs=PARTS_WITHIN * exact[2])


@pytest.mark.parametrize(
    ("quaternion", "corners"),
    [([1.0, 0, 0, 0], 4), ([math.cos(0.4), 0, math.sin(0.4), 0], 2)],
    ids=["face", "edge"],
)
def test_corners_that_strike_together_all_leave(quaternion, corners):
    """Straight down: a face bounces like a ball; an edge turns the cube; as one impulse would."""
    solid = cube(friction=0.0, restitution=0.25)
    _, after, levers = struck(solid, np.array(quaternion), (0.3, 0.0, -1.0), (0, 0, 0))
    assert len(levers) == corners
    for lever in levers:
        assert corner_speed(solid, after, lever)[2] == pytest.approx(0.25, abs=1e-8)
    lever = levers.mean(axis=0)
    turn = np.cross(lever, [0, 0, 1])
    push = 1.25 / (1 + turn @ turn / float(solid.inertia_m2[0]))
    assert float(after.velocity_m_s[2]) == pytest.approx(push - 1.0, abs=1e-8)
    assert np.asarray(after.momentum_m2_s) == pytest.approx(push * turn, abs=1e-8)


def test_no_impact_gains_energy():
    """Of 200 corners at random, rough and smooth, with a centre of mass off the middle."""
    rng = np.random.default_rng(14)

    def change(quaternion, velocity, spin, friction, restitution):
        solid = cube(friction=friction, restitution=restitution)
        solid = solid._replace(corners_m=solid.corners_m - jnp.array([0.0, 0.002, 0.006]))
        lever = levers_m(solid, quaternion / jnp.linalg.norm(quaternion))
        low = jnp.argsort(lever[:, 2])[:4]
        pose = thrown(solid, jnp.array([0, 0, -lever[low[0], 2]]), quaternion, velocity, spin)
        falls = climbs_m_s(solid, pose)[low[0]] < 0
        after = engine_body._struck(pose, solid, jnp.arange(8) == low[0], low)
        return falls, energy_j_kg(solid, after) - energy_j_kg(solid, pose)

    count = 200
    falls, gain = jax.vmap(change)(
        jnp.asarray(rng.normal(size=(count, 4))),
        jnp.asarray(rng.normal(0, 1, (count, 3)) - np.array([0, 0, 1.0])),
        jnp.asarray(rng.normal(0, 5, (count, 3))),
        jnp.asarray(rng.uniform(0, 0.6, count)),
        jnp.asarray(rng.uniform(0, 0.6, count)),
    )
    falls, gain = np.asarray(falls), np.asarray(gain)
    assert falls.sum() > 100
    assert gain[falls].max() < 1e-9
