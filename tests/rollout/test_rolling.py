"""Round objects: the contact decides whether they roll or slip."""

import math
from dataclasses import replace

import jax.numpy as jnp
import mujoco
import numpy as np
import pytest

from galileo_jax.model.effects.registry import make_effects
from galileo_jax.model.parameters import inverse
from galileo_jax.rollout.engine_path import EnginePath
from galileo_jax.rollout.engines import make_engine
from galileo_jax.runtime.errors import InputError
from galileo_jax.simulation.solver import STEP_S, STEPS_PER_RECORD, solve
from tests.rollout.objects import BALL, BOX, ROLLER, WHEEL, model_of, scene_of, speeds, theta_of
from tests.rollout.rolled import derivatives

G = 9.81
EXACT_RTOL = 1e-9
# Small steps are of first order at an impact; 0.05 mm over 3 s is their usual error.
SMALL_STEPS_ATOL_M = 3e-4
# MuJoCo's contacts slip a little to rub (their friction is a constraint of finite stiffness).
MUJOCO_RTOL = 0.005
STEP_Z, SLOPE_RTOL = 0.01, 1e-3

BETA = {"sphere": 2 / 5, "cylinder": 1 / 2, "torus": (22**2 + 0.75 * 8**2) / 30**2}
ROUND = {"sphere": BALL, "cylinder": ROLLER, "torus": WHEEL}


def on_incline(thing, angle_deg, friction, duration_s=0.5, **given):
    scene = scene_of([thing], angle_deg, has_table=False)
    model = model_of([thing], scene, duration_s)
    return speeds(model, theta_of(model, [0.4], [friction], **given))


@pytest.mark.parametrize("angle_deg", [5.0, 20.0, 40.0])
@pytest.mark.parametrize("shape", ROUND)
def test_rolls_down_in_closed_form(shape, angle_deg):
    """2/3 g sin a of a cylinder, 5/7 g sin a of a ball, and the torus's; whatever k above it."""
    assert ROUND[shape].roll_inertia == pytest.approx(BETA[shape])
    angle, beta = math.radians(angle_deg), BETA[shape]
    needed = math.tan(angle) * beta / (1 + beta)
    wanted = G * math.sin(angle) / (1 + beta)
    for friction in (1.001 * needed, 0.9):
        times, (speed,) = on_incline(ROUND[shape], angle_deg, friction)
        assert speed == pytest.approx(wanted * times, rel=EXACT_RTOL)


@pytest.mark.parametrize("shape", ROUND)
def test_slips_with_too_little_friction(shape):
    angle, beta = math.radians(30), BETA[shape]
    for share in (0.999, 0.3):
        friction = share * math.tan(angle) * beta / (1 + beta)
        times, (speed,) = on_incline(ROUND[shape], 30.0, friction)
        wanted = G * (math.sin(angle) - friction * math.cos(angle))
        assert speed == pytest.approx(wanted * times, rel=EXACT_RTOL)


def test_a_share_may_be_declared():
    pipe = ROLLER.model_copy(update={"rolls": 1.0})
    times, (speed,) = on_incline(pipe, 20.0, 0.9)
    assert speed == pytest.approx(0.5 * G * math.sin(math.radians(20)) * times, rel=EXACT_RTOL)


def test_the_foot_turns_a_roller_without_braking_it():
    """It keeps (cos a + beta) / (1 + beta) of its speed, and rolls on unbraked."""
    model = model_of([ROLLER], scene_of([ROLLER], 20.0, 0.4), 1.2)
    times, (speed,) = speeds(model, theta_of(model, [0.5], [0.9]))
    a, beta = math.radians(20), 0.5
    way = -model.scene.surroundings.start_path_m[0]
    down = math.sqrt(2 * G * math.sin(a) / (1 + beta) * way)
    late = times > 2 * way / down
    assert late.sum() > 50
    assert speed[late] == pytest.approx(down * (math.cos(a) + beta) / (1 + beta), rel=EXACT_RTOL)


def test_a_ball_that_is_hit_slips_until_it_rolls():
    """Braked by k g for v0 / (k g (1 + m r^2 / J)); then 5/7 of the speed it was given stay."""
    model = model_of([BOX, BALL], scene_of([BOX, BALL], 35.0, 0.4, [0.3]), 1.6)
    mass, (k1, k2) = (0.5, 0.1), (0.2, 0.1)
    times, (_, ball) = speeds(model, theta_of(model, mass, (k1, k2)))
    a, corner = math.radians(35), model.scene.surroundings.corner_m[0]
    square = 2 * G * (math.sin(a) - k1 * math.cos(a)) * -model.scene.surroundings.start_path_m[0]
    square *= (math.cos(a) - k1 * math.sin(a)) ** 2
    given = math.sqrt(square - 2 * k1 * G * (0.3 - 0.06 - corner)) * mass[0] / sum(mass)
    slips = times[np.argmax(ball > 0)] + given / (k2 * G * 3.5)
    late = times > slips
    assert late.sum() > 50
    assert ball[late] == pytest.approx(given * 5 / 7, rel=EXACT_RTOL)
    braked = np.diff(ball[(ball > 0) & (times < slips - 0.01)]) / np.diff(times)[0]
    assert braked == pytest.approx(-k2 * G, rel=1e-6)


def test_what_is_pushed_rolls_from_the_hand():
    scene = scene_of([BALL], 10.0, has_table=False)
    model = model_of([BALL], scene, 0.5)
    model = replace(model, effects=make_effects(["initial_push"]))
    times, (speed,) = speeds(model, theta_of(model, [0.4], [0.5], initial_push=0.7))
    wanted = 0.7 + 5 / 7 * G * math.sin(math.radians(10)) * times
    assert speed == pytest.approx(wanted, rel=EXACT_RTOL)


SCENES = {
    "ball into boxes": ([BALL, BOX, BOX], (0.3, 0.1, 0.15)),
    "box into balls": ([BOX, BALL, BALL], (0.05, 0.02, 0.3)),
    "roller into roller into box": ([ROLLER, ROLLER, BOX], (0.4, 0.05, 0.2)),
    "slippery ball into wheel": ([BALL, WHEEL, BALL], (0.03, 0.1, 0.02)),
    "three boxes": ([BOX, BOX, BOX], (0.05, 0.2, 0.1)),
}


@pytest.mark.parametrize("restitution", [0.0, 0.4])
@pytest.mark.parametrize("case", [pytest.param(case, marks=pytest.mark.slow) for case in SCENES])
def test_small_steps_agree(case, restitution):
    """Moreau's time stepping, which knows of no events."""
    objects, friction = SCENES[case]
    mass = [0.4, 0.3, 0.5]
    scene = scene_of(objects, 25.0, 0.45, [0.25, 0.34])
    model = model_of(objects, scene, 2.0)
    theta = theta_of(model, mass, friction, impact_restitution=restitution)
    position, _ = EnginePath(model).simulate(theta[None])
    named = {name: float(theta[i]) for i, name in enumerate(model.names)}
    path, _, _ = solve(model.nuisances, scene, named, 2.0)
    moments = np.arange(len(path)) * STEP_S * STEPS_PER_RECORD
    times = np.arange(position.shape[-1]) * model.record_dt_s
    shown = times < 2.0
    for i in range(3):
        small = np.interp(times[shown], moments, path[:, i])
        x = position[0, i, 0, shown] - scene.corner_m[i]
        cos = math.cos(scene.angle_rad)
        assert np.where(x < 0, x / cos, x) == pytest.approx(small, abs=SMALL_STEPS_ATOL_M)
    if restitution == 0.0:
        gaps = np.diff(position[0, :, 0], axis=0)
        touching = np.add(scene.half_length_m[1:], scene.half_length_m[:-1])
        assert (gaps - touching[:, None]).min() > -1e-9, "nothing passes through anything"


def test_momentum_of_three():
    """On a smooth table what object 1 brings is what all three have."""
    objects, mass = [BOX, BOX, BOX], np.array([0.5, 0.3, 0.4])
    model = model_of(objects, scene_of(objects, 20.0, 0.5, [0.2, 0.35]), 1.6)
    for e in (0.0, 0.5):
        _, v = speeds(model, theta_of(model, list(mass), [1e-5] * 3, impact_restitution=e))
        momentum = mass @ v
        hit = int(np.argmax(v[1] > 0))
        assert v[2, -1] > v[1, -1] - 1e-9 and v[1, -1] > v[0, -1] - 1e-9
        assert v[2, -1] > 0.1
        assert momentum[hit:] == pytest.approx(momentum[hit - 1], abs=2e-4)


@pytest.mark.parametrize("shape", ["sphere", "cylinder"])
@pytest.mark.parametrize("friction", [0.05, 0.6])
def test_mujoco_agrees(shape, friction):
    """MuJoCo's own geom, free to turn, on a plane: rolling, and slipping at 0.05."""
    angle = math.radians(30)
    sin, cos = math.sin(angle), math.cos(angle)
    size = "0.03" if shape == "sphere" else "0.03 0.025"
    spec = f"""
    <mujoco>
      <option timestep="0.0005" cone="elliptic" gravity="{G * sin} 0 {-G * cos}"
              iterations="50" tolerance="1e-12" impratio="100"/>
      <worldbody>
        <geom name="board" type="plane" size="0 0 1"/>
        <body pos="0 0 0.03"><freejoint/>
          <geom name="thing" type="{shape}" size="{size}" euler="90 0 0" mass="0.4"/>
        </body>
      </worldbody>
      <contact><pair geom1="board" geom2="thing" condim="3" friction="{friction} {friction} 0 0 0"
        solref="0.002 1"/></contact>
    </mujoco>"""
    model = mujoco.MjModel.from_xml_string(spec)  # pyright: ignore
    data = mujoco.MjData(model)  # pyright: ignore
    mujoco.mj_step(model, data, nstep=1000)  # pyright: ignore
    times, (speed,) = on_incline(ROUND[shape], 30.0, friction)
    wanted = float(np.interp(0.5, times, speed))
    assert data.qvel[0] == pytest.approx(wanted, rel=MUJOCO_RTOL)


def test_derivatives_are_those_of_the_motion():
    objects = [BALL, BOX]
    model = model_of(objects, scene_of(objects, 20.0, 0.5, [0.25]), 1.2)
    theta = theta_of(model, [0.5, 0.3], [0.3, 0.1], impact_restitution=0.3, contact_gap=3e-4)
    z = inverse(model.parameters, jnp.asarray(theta))
    engine = EnginePath(model)
    times = jnp.asarray([0.2, 0.4, 1.1, 1.15])

    slopes, differences = derivatives(engine, z, times, STEP_Z)
    for i, parameter in enumerate(model.parameters):
        size = np.linalg.norm(differences[i])
        error = np.linalg.norm(slopes[..., i] - differences[i])
        assert error <= SLOPE_RTOL * size + 1e-7, f"{parameter.name}: {error} of {size}"


def test_the_effect_rolling_has_no_place_on_what_is_declared_to_roll():
    (effect,) = make_effects(["rolling"])
    assert not effect.parameters(scene_of([BALL, BOX], beyond_m=[0.3]))
    assert effect.parameters(scene_of([BOX, BALL], beyond_m=[0.3]))


def test_mujocos_engines_have_nothing_that_rolls():
    model = model_of([BALL], scene_of([BALL]), 0.5)
    with pytest.raises(InputError, match="nothing that rolls; rigid or auto expected"):
        make_engine("c", model)
