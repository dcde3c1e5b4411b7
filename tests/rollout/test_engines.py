"""MuJoCo's engines against closed forms, against each other, and against the rigid engine."""

import math
from dataclasses import replace

import mujoco
import numpy as np
import pytest

from galileo_jax.model.model import Model
from galileo_jax.rollout.engine_c import EngineC
from galileo_jax.rollout.engine_mjx import EngineMJX
from galileo_jax.rollout.engine_path import EnginePath
from galileo_jax.rollout.motion import dynamics
from galileo_jax.rollout.mujoco_fields import FOOT_ZONE_M, make_fields
from tests.precision import in_64_bit
from tests.ramp_model import HIT, SMOOTH, make_model, make_theta
from tests.reference_ramp import solve
from tests.rollout.simple_effects import EVERY_KIND

ENGINES = ("c", "mjx")
ACCELERATION_RTOL = 0.005  # the issue's bar; 0.003 is what the contacts' onset costs
# Recorded steps between which it is measured: the contact has settled, the foot is not reached.
SETTLED, STILL_ON_RAMP = 30, 80
ENGINES_ATOL_M_S = 1e-3  # the bar; 2e-6 is typical, a contact's on and off the rest
MOMENTUM_RTOL = 0.01
PLASTIC = 0.02
POSITION_ATOL_M = 0.002  # compliant contacts turn at the foot in 2 ms, at up to 1.7 m/s
CREEP_M_S, CREEP_FROM = 2e-4, 120  # recorded steps: by then the contact carries the weight
HALVING_ATOL_M_S = 5e-4
# What a jump of the velocity depends on its phase in the grid of steps.
HALVING_JUMP_ATOL_M_S = 0.002
AT_REST_M_S = 0.02
FOOT_S, HIT_S = 0.2, 0.1  # until the contacts have settled again
# The C engine against the rigid one, away from impacts by FOOT_S or HIT_S: the ripple after the
# foot, and forces that are held for a recorded step.
RIGID_POSITION_ATOL_M, RIGID_VELOCITY_ATOL_M_S = 0.003, 0.01
ROUNDING_M = 1e-9  # stiff contacts make more of the last digit
FACTOR_ATOL = 0.004  # the zone is crossed in some 17 ms, in steps of 4 ms
STRENGTHS = {
    "drag": 0.1,
    "spring": 0.5,
    "wind": 0.1,
    "swaying": 0.1,
    "stribeck": 0.5,
    "turning": 0.4,
    "tilt": 0.02,
    "push": 0.3,
}


def accelerations(engine, theta):
    """Along the ramp, `[batch]`, and how far object 1 is from the foot at the end."""
    position, velocity = engine.simulate(theta)
    speed = np.hypot(velocity[:, 0, 0], velocity[:, 0, 1])
    elapsed = (STILL_ON_RAMP - SETTLED) * engine.model.record_dt_s
    assert (position[:, 0, 0, STILL_ON_RAMP] < -0.01).all()
    return (speed[:, STILL_ON_RAMP] - speed[:, SETTLED]) / elapsed


def draws(rng, experiment, count):
    """Frictions with which object 1 slides, and any masses."""
    steepest = math.tan(experiment.angle_rad)
    return [
        replace(
            experiment,
            friction=(rng.uniform(0, 0.8 * steepest), rng.uniform(0.05, 0.5)),
            mass_kg=tuple(rng.uniform(0.1, 1.5, 2)),
        )
        for _ in range(count)
    ]


def expected_acceleration(experiment):
    angle, k1 = experiment.angle_rad, experiment.friction[0]
    return experiment.gravity * (math.sin(angle) - k1 * math.cos(angle))


@pytest.mark.parametrize("angle_deg", [10, 20, 33])
def test_ramp_acceleration(angle_deg):
    experiments = draws(
        np.random.default_rng(angle_deg), replace(HIT, angle_rad=math.radians(angle_deg)), 20
    )
    engine = EngineC(make_model(experiments[0], 0.5))
    measured = accelerations(
        engine, np.stack([make_theta(engine.model, one) for one in experiments])
    )
    expected = [expected_acceleration(one) for one in experiments]
    assert measured == pytest.approx(expected, rel=ACCELERATION_RTOL)


def test_ramp_acceleration_of_random_angles():
    rng = np.random.default_rng(1)
    for angle_deg in rng.uniform(5, 35, 10):
        given = replace(HIT, angle_rad=math.radians(angle_deg))
        (experiment,) = draws(rng, given, 1)
        engine = EngineC(make_model(experiment, 0.5))
        measured = accelerations(engine, make_theta(engine.model, experiment)[None])[0]
        assert measured == pytest.approx(expected_acceleration(experiment), rel=ACCELERATION_RTOL)


@pytest.fixture(scope="module")
def pairs(engines):
    """Twenty random experiments on one ramp, by both engines."""
    experiments = draws(np.random.default_rng(2), HIT, 20)
    theta = np.stack([make_theta(engines["c"].model, one) for one in experiments])
    with in_64_bit():
        return experiments, {name: engines[name].simulate(theta) for name in ENGINES}


@pytest.mark.slow
def test_ramp_acceleration_in_mjx(pairs, engines):
    experiments, found = pairs
    _, velocity = found["mjx"]
    speed = np.hypot(velocity[:, 0, 0], velocity[:, 0, 1])
    elapsed = (STILL_ON_RAMP - SETTLED) * engines["mjx"].model.record_dt_s
    measured = (speed[:, STILL_ON_RAMP] - speed[:, SETTLED]) / elapsed
    expected = [expected_acceleration(one) for one in experiments]
    assert measured == pytest.approx(expected, rel=ACCELERATION_RTOL)


@pytest.mark.slow
def test_engines_agree(pairs):
    _, found = pairs
    (position_c, velocity_c), (position_mjx, velocity_mjx) = found["c"], found["mjx"]
    assert velocity_mjx == pytest.approx(velocity_c, abs=ENGINES_ATOL_M_S)
    assert position_mjx == pytest.approx(position_c, abs=ENGINES_ATOL_M_S)


@pytest.mark.slow
@pytest.mark.parametrize("name", ENGINES)
def test_hit_is_plastic_and_keeps_momentum(name, engines):
    engine = engines[name]
    for mass in ((0.5, 0.3), (0.2, 0.9), (0.9, 0.2)):
        theta = make_theta(engine.model, replace(SMOOTH, mass_kg=mass))
        velocity = engine.simulate(theta[None])[1][0, :, 0]
        before = velocity[0].max()
        first, second = velocity[:, -1]
        assert mass[0] * first + mass[1] * second == pytest.approx(
            mass[0] * before, rel=MOMENTUM_RTOL
        )
        assert abs(second - first) <= PLASTIC * before


def test_follows_the_closed_form():
    rng = np.random.default_rng(3)
    for angle_deg in (10, 20, 20, 25, 25):
        given = replace(HIT, angle_rad=math.radians(angle_deg))
        (experiment,) = draws(rng, given, 1)
        engine = EngineC(make_model(experiment, 1.5))
        position, _ = engine.simulate(make_theta(engine.model, experiment)[None])
        times = np.arange(position.shape[-1]) * engine.model.record_dt_s
        exact = solve(experiment, times).position_m
        assert position[0] == pytest.approx(exact, abs=POSITION_ATOL_M)


def with_effect(model, effect):
    """The model with one effect, at its strength and absent, `[2, parameter]`."""
    richer = replace(model, effects=(effect,))
    strengths = STRENGTHS[effect.name], 0.0
    return richer, np.stack([make_theta(richer, HIT, {effect.name: s}) for s in strengths])


def quiet(velocity, dt):
    """Which records are away from every jump of the rigid motion's velocity, `[record]`."""
    change = np.abs(np.diff(velocity)).max(axis=(0, 1))
    times = np.arange(velocity.shape[-1]) * dt
    away = np.ones(len(times), bool)
    for jump in times[1:][change > 0.1]:
        away &= (times < jump - 0.01) | (times > jump + FOOT_S)
    return away


@pytest.mark.parametrize("effect", EVERY_KIND, ids=lambda effect: effect.name)
def test_c_and_rigid_agree_on_effects(effect):
    """Two engines that share the equations of motion and nothing of how they are solved."""
    model, theta = with_effect(make_model(HIT, 1.5), effect)
    (position_c, velocity_c), (position, velocity) = (
        engine(model).simulate(theta) for engine in (EngineC, EnginePath)
    )
    assert position_c == pytest.approx(position, abs=RIGID_POSITION_ATOL_M)
    assert np.abs(position[0] - position[1]).max() > 5 * RIGID_POSITION_ATOL_M
    for found, wanted in zip(velocity_c, velocity, strict=True):
        away = quiet(wanted, model.record_dt_s)
        assert away.mean() > 0.5
        assert found[..., away] == pytest.approx(wanted[..., away], abs=RIGID_VELOCITY_ATOL_M_S)


@pytest.mark.parametrize("effect", EVERY_KIND, ids=lambda effect: effect.name)
def test_absent_effects_are_not_there(effect):
    plain = make_model(HIT, 1.2)
    model, theta = with_effect(plain, effect)
    found = EngineC(model).simulate(theta[1:])
    wanted = EngineC(plain).simulate(make_theta(plain, HIT)[None])
    until = slice(0, 200)  # the plain one may be told to be at rest, later
    assert found[0][..., until] == pytest.approx(wanted[0][..., until], abs=ROUNDING_M)


@pytest.mark.slow
def test_mjx_and_c_agree_on_effects():
    """All effects at once, so that MJX is compiled once."""
    model = replace(make_model(HIT, 0.9), effects=EVERY_KIND)
    theta = make_theta(model, HIT, STRENGTHS)[None]
    position_c, velocity_c = EngineC(model).simulate(theta)
    position, velocity = EngineMJX(model).simulate(theta)
    assert position == pytest.approx(position_c, abs=ENGINES_ATOL_M_S)
    assert velocity == pytest.approx(velocity_c, abs=ENGINES_ATOL_M_S)


def test_foot_transition_is_the_factor_on_the_speed():
    experiment = replace(SMOOTH, object2_x_m=0.6)
    model = make_model(experiment, 1.0)
    theta = np.stack(
        [make_theta(model, experiment, {"foot_transition": f}) for f in (1.0, 0.9, 0.95, 1.05)]
    )
    position, velocity = EngineC(model).simulate(theta)
    beyond = np.argmax(position[:, 0, 0] > FOOT_ZONE_M + 0.03, axis=-1)
    speeds = np.array([v[0, 0, i] for v, i in zip(velocity, beyond, strict=True)])
    assert speeds[1:] / speeds[0] == pytest.approx([0.9, 0.95, 1.05], abs=FACTOR_ATOL)


@pytest.mark.parametrize("angle_deg", [10, 20, 30])
def test_nothing_moves_above_the_friction_angle(angle_deg):
    still = replace(HIT, angle_rad=math.radians(angle_deg))
    engine = EngineC(make_model(still, 2.0))
    steepest = math.tan(still.angle_rad)
    theta = np.stack(
        [
            make_theta(engine.model, replace(still, friction=(share * steepest, 0.2)))
            for share in (1.02, 1.5, 2.5)
        ]
    )
    position, velocity = engine.simulate(theta)
    # Until the contact carries the weight it gives way by less than a millimetre.
    assert position == pytest.approx(np.broadcast_to(position[..., :1], position.shape), abs=1e-3)
    assert np.abs(velocity[..., CREEP_FROM:]).max() < CREEP_M_S


@pytest.mark.parametrize("friction", [(0.1, 0.2), (0.2, 0.1), (0.05, 0.05)])
def test_halving_the_steps(friction):
    experiment = replace(HIT, friction=friction)
    model = make_model(experiment, 1.4)
    fine = Model(replace(model.scene, timestep_s=model.scene.timestep_s / 2), 1.4)
    theta = make_theta(model, experiment)[None]
    coarse = EngineC(model).simulate(theta)[1][0]
    halved = EngineC(fine).simulate(theta)[1][0][..., ::2]
    count = min(coarse.shape[-1], halved.shape[-1])
    change = (halved[..., :count] - coarse[..., :count])[:, 0]
    times = np.arange(count) * model.record_dt_s
    solved = solve(experiment, times)
    assert solved.foot_s and solved.hit_s
    stops = times[np.flatnonzero(coarse[0, 0, :count] > AT_REST_M_S)[-1]]
    for begin, end in (
        (0, solved.foot_s),
        (solved.foot_s + FOOT_S, solved.hit_s),
        (solved.hit_s + HIT_S, stops),
    ):
        phase = change[:, (times > begin) & (times < end - 0.01)]
        if phase.size:
            assert np.ptp(phase, axis=1).max() < HALVING_ATOL_M_S
            assert np.abs(phase).max() < HALVING_JUMP_ATOL_M_S


def test_masses_carry_their_inverse_weights(engines):
    """MJX's scaled fields are what MuJoCo's own mj_setConst makes of the masses."""
    model, engine = engines["mjx"].model, engines["mjx"]
    assert isinstance(engine, EngineMJX)
    experiment = replace(HIT, mass_kg=(0.21, 1.3))
    theta = make_theta(model, experiment)
    scene = model.scene.surroundings
    law = dynamics(model.nuisances, scene, model.by_name(theta), np)
    fields = make_fields(law, scene, np)
    scaled = engine._with(fields)
    spec = model.scene.spec.copy()
    for name, mass in zip(model.scene.names, experiment.mass_kg, strict=True):
        spec.body(name).inertia *= mass / spec.body(name).mass
        spec.body(name).mass = mass
    compiled = spec.compile()
    mujoco.mj_setConst(compiled, mujoco.MjData(compiled))  # pyright: ignore
    for field in ("body_mass", "body_inertia", "body_invweight0", "dof_invweight0"):
        got, wanted = np.asarray(getattr(scaled, field)), getattr(compiled, field)
        assert got == pytest.approx(wanted, rel=1e-6), field


def test_bad_parameters_spoil_only_their_own_rollout(engines):
    engine = engines["c"]
    theta = np.tile(make_theta(engine.model, HIT), (3, 1))
    theta[1, 0] = np.nan
    position, velocity = engine.simulate(theta)
    assert np.isnan(position[1]).all() and np.isnan(velocity[1]).all()
    alone, _ = engine.simulate(theta[:1])
    assert (position[[0, 2]] == alone).all()
