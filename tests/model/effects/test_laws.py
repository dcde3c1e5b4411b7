"""Each effect's motion against its closed form, momentum or energy; rigid engine."""

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from galileo_jax.model.effects import make_effects
from galileo_jax.model.effects.effect import State
from galileo_jax.model.effects.zone import share_inside
from tests.model.effects.motion import (
    ALONE,
    LONG_RAMP,
    LONG_TABLE,
    PAIR,
    film,
    move,
    slide_m_s2,
)
from tests.ramp_model import HIT, SMOOTH, make_surroundings

EXACT = 1e-9  # the midpoint rule is exact for constant forces
# Midpoint steps of 1/240 s for forces that change with speed: second order, 1e-5 for air drag.
MIDPOINT_M_S = 1e-4
# A zone whose edges are 5 mm, crossed in steps of up to 9 mm: the worst of 600 draws was off by
# 4 mm/s of 1.4 m/s (brake), 0.002 J/kg of 0.48 (patch).
ZONE_RTOL, ZONE_ATOL = 5e-3, 2e-3
SLOW_S = 5e-4  # 0.02 m/s is passed within two steps of 4 ms
G, ANGLE, (M1, M2) = HIT.gravity, HIT.angle_rad, HIT.mass_kg


def on_table(motion, after_m=0.0):
    """Object 1's x and speed where it is past the foot by more than `after_m`."""
    x, speed = motion.position_m[0, 0], motion.speed_m_s[0]
    past = x > make_surroundings(ALONE).corner_m[0] + after_m
    return x[past], speed[past]


@pytest.mark.parametrize("c", [0.05, 0.5, 3.0])
def test_air_drag_nears_its_terminal_speed(c):
    motion = move(LONG_RAMP, {"air_drag": c})
    a = slide_m_s2(LONG_RAMP)
    terminal = math.sqrt(M1 * a / c)
    expected = terminal * np.tanh(a * motion.times_s / terminal)
    assert motion.speed_m_s[0] == pytest.approx(expected, abs=MIDPOINT_M_S)


@pytest.mark.parametrize("b", [0.1, 1.0, 5.0])
def test_viscous_drag_nears_its_terminal_speed(b):
    motion = move(LONG_RAMP, {"viscous_drag": b})
    expected = M1 * slide_m_s2(LONG_RAMP) / b * (1 - np.exp(-b * motion.times_s / M1))
    assert motion.speed_m_s[0] == pytest.approx(expected, abs=MIDPOINT_M_S)


@pytest.mark.parametrize(("name", "power"), [("viscous_drag", 1), ("air_drag", 2)])
def test_drags_act_on_object_2_too(name, power):
    """After a plastic hit without friction both go on as one, with twice the drag."""
    motion = move(SMOOTH, {name: 0.5})
    after = np.flatnonzero(motion.speed_m_s[1] > 0)[1:]
    v, t = motion.speed_m_s[1, after], motion.times_s[after]
    assert motion.speed_m_s[0, after] == pytest.approx(v, abs=1e-8)
    rate, elapsed = 2 * 0.5 / (M1 + M2), t - t[0]
    expected = v[0] * np.exp(-rate * elapsed) if power == 1 else v[0] / (1 + v[0] * rate * elapsed)
    assert v == pytest.approx(expected, abs=MIDPOINT_M_S)


@pytest.mark.parametrize(("a", "speed"), [(0.5, 0.4), (2.0, 0.2), (1.0, 1.0)])
def test_stribeck(a, speed):
    """v' = A - B exp(-v / v_s) has v_s / A log((A exp(v / v_s) - B) / (A - B)) = t."""
    motion = move(LONG_RAMP, {"stribeck": a, "stribeck_speed": speed})
    fast = slide_m_s2(LONG_RAMP)
    slow = G * a * LONG_RAMP.friction[0] * math.cos(ANGLE)
    grown = slow + (fast - slow) * np.exp(fast * motion.times_s / speed)
    expected = speed * np.log(grown / fast)
    assert motion.speed_m_s[0] == pytest.approx(expected, abs=MIDPOINT_M_S)


@pytest.mark.parametrize(("share", "holds"), [(0.98, False), (1.02, True)])
def test_static_friction_holds_up_to_its_angle(share, holds):
    extra = share * math.tan(ANGLE) - LONG_RAMP.friction[0]
    motion = move(LONG_RAMP, {"static_friction": extra})
    assert (np.abs(motion.speed_m_s[0]).max() == 0.0) == holds


def test_static_friction_is_not_felt_by_what_slides():
    given = {"static_friction": 1.0, "initial_push": 0.3}
    motion = move(LONG_RAMP, given)
    expected = 0.3 + slide_m_s2(LONG_RAMP) * motion.times_s
    assert motion.speed_m_s[0] == pytest.approx(expected, abs=EXACT)


@pytest.mark.parametrize("extra", [0.05, 0.1, 0.2])
def test_static_friction_delays_the_start(extra):
    """Fast again, it is late by the integral of 1 / (A - B exp(-(v / v_s)^2)) - 1 / A."""
    motion = move(LONG_RAMP, {"static_friction": extra})
    a, b = slide_m_s2(LONG_RAMP), G * extra * math.cos(ANGLE)
    v = np.linspace(0.0, 0.2, 20_001)
    late = np.trapezoid(1 / (a - b * np.exp(-((v / 0.02) ** 2))) - 1 / a, v)
    fast = motion.speed_m_s[0] > 0.2
    found = motion.times_s[fast] - motion.speed_m_s[0, fast] / a
    assert found == pytest.approx(late, abs=SLOW_S)


@settings(max_examples=20)
@given(e=st.floats(0.05, 1.0), m1=st.floats(0.1, 2.0), m2=st.floats(0.1, 2.0))
def test_restitution_is_the_one_named(e, m1, m2):
    experiment = replace(SMOOTH, mass_kg=(m1, m2))
    motion = move(experiment, {"restitution": e})
    first, second = motion.speed_m_s
    at = np.flatnonzero(second > 0)[1]
    before = first[second == 0][-1]
    assert second[at] - first[at] == pytest.approx(e * before, rel=1e-5)
    assert m1 * first[at] + m2 * second[at] == pytest.approx(m1 * before, rel=1e-5)


@pytest.mark.parametrize("share", [2 / 5, 1 / 2, 1.0])
def test_rolling(share):
    motion = move(replace(LONG_RAMP, friction=(0.0, 0.0)), {"rolling": share})
    expected = G * math.sin(ANGLE) / (1 + share) * motion.times_s
    # Friction is never less than MuJoCo's least, 1e-5.
    assert motion.speed_m_s[0] == pytest.approx(expected, abs=2e-4)


TIMES_S = np.linspace(0.0, 0.8, 25)
CORNER_M = make_surroundings(ALONE).corner_m[0]


def gone(given):
    """How far object 1 is seen to go, in the clip's time."""
    seen = film(LONG_RAMP, given, TIMES_S)[0]
    return np.hypot(*(seen - seen[:, :1]))


def test_release_delay():
    moving = np.maximum(TIMES_S - 0.2, 0.0)
    expected = 0.5 * slide_m_s2(LONG_RAMP) * moving**2
    assert gone({"release_delay": 0.2}) == pytest.approx(expected, abs=EXACT)


@pytest.mark.parametrize("r", [-0.1, 0.1])
def test_frame_rate_is_another_gravity(r):
    expected = 0.5 * slide_m_s2(LONG_RAMP) * (1 + r) ** 2 * TIMES_S**2
    assert gone({"frame_rate": r}) == pytest.approx(expected, abs=EXACT)


def test_the_clock_is_corrected_before_the_delay():
    moving = np.maximum(1.1 * TIMES_S - 0.2, 0.0)
    found = gone({"release_delay": 0.2, "frame_rate": 0.1})
    assert found == pytest.approx(0.5 * slide_m_s2(LONG_RAMP) * moving**2, abs=EXACT)


@pytest.mark.parametrize("s", [-0.1, 0.1])
def test_scale_error_is_another_gravity_seen_from_the_same_start(s):
    expected = 0.5 * slide_m_s2(LONG_RAMP) * (1 + s) * TIMES_S**2
    assert gone({"scale_error": s}) == pytest.approx(expected, abs=EXACT)
    start = film(HIT, {"scale_error": s}, TIMES_S)[..., 0]
    declared = np.asarray(make_surroundings(HIT).start_m)
    # Sizes are true: only what the objects' heights put beside the foot is scaled.
    assert start == pytest.approx(declared, abs=1.01 * abs(s) * HIT.size_m[0][1] / 2)


@pytest.mark.parametrize("push", [0.1, 1.0])
def test_initial_push(push):
    motion = move(LONG_RAMP, {"initial_push": push})
    expected = push + slide_m_s2(LONG_RAMP) * motion.times_s
    assert motion.speed_m_s[0] == pytest.approx(expected, abs=EXACT)
    assert (motion.speed_m_s[1] == 0).all()


@pytest.mark.parametrize("tilt", [-0.05, 0.05])
def test_ramp_angle(tilt):
    motion = move(LONG_RAMP, {"ramp_angle": tilt})
    expected = slide_m_s2(LONG_RAMP, ANGLE + tilt) * motion.times_s
    assert motion.speed_m_s[0] == pytest.approx(expected, abs=EXACT)
    vx, vy = motion.velocity_m_s[0]
    assert np.arctan2(-vy[5:], vx[5:]) == pytest.approx(ANGLE + tilt)


@pytest.mark.parametrize("tilt", [-0.05, 0.03])
def test_table_tilt(tilt):
    rough = replace(LONG_TABLE, friction=(0.1, 0.0))
    motion = move(rough, {"table_tilt": tilt})
    _, speed = on_table(motion)
    moving = speed[speed > 0][:-1]
    rate = G * (math.sin(tilt) - 0.1 * math.cos(tilt)) * (motion.times_s[1])
    assert np.diff(moving) == pytest.approx(rate, abs=EXACT)
    vx, vy = motion.velocity_m_s[0][:, motion.position_m[0, 0] > CORNER_M + 0.01]
    assert np.arctan2(-vy, vx)[vx > 0] == pytest.approx(tilt)


@pytest.mark.parametrize("levelness", [0.0, 0.4, 1.0])
@pytest.mark.parametrize("force", [0.4, -0.1])
def test_constant_force(force, levelness):
    """Along the ramp, or level: then F cos a pulls along it and F sin a lifts off."""
    given = {"constant_force": force, "constant_force_levelness": levelness}
    motion = move(LONG_RAMP, given)
    along = force * (1 - levelness + levelness * math.cos(ANGLE))
    lifted = levelness * force * math.sin(ANGLE)
    pulled = slide_m_s2(LONG_RAMP) + (along + LONG_RAMP.friction[0] * lifted) / M1
    assert motion.speed_m_s[0] == pytest.approx(pulled * motion.times_s, abs=EXACT)
    assert (motion.speed_m_s[1] == 0).all()


@pytest.mark.parametrize("levelness", [0.0, 1.0])
def test_on_the_table_a_constant_force_is_level(levelness):
    given = {"constant_force": -0.2, "constant_force_levelness": levelness}
    _, speed = on_table(move(LONG_TABLE, given))
    moving = speed[speed > 0][:-1]
    assert np.diff(moving) == pytest.approx(-0.2 / M1 / 240, abs=1e-6)


@pytest.mark.parametrize("share", [0.0, 0.6, 1.0])
def test_a_wind_moves_the_others_too(share):
    """As soon as it pulls more than friction holds."""
    rough = replace(LONG_TABLE, friction=(0.1, 0.02))
    motion = move(rough, {"constant_force": 0.2, "constant_force_on_others": share})
    pulled = max(0.0, 0.2 * share / M2 - 0.02 * G)
    assert motion.speed_m_s[1] == pytest.approx(pulled * motion.times_s, abs=EXACT)


PATCH = {"friction_patch_start": 0.2, "friction_patch_length": 0.1, "friction_patch_edge": 0.005}
BRAKE = {"magnetic_brake_start": 0.2, "magnetic_brake_length": 0.1, "magnetic_brake_edge": 0.005}


def test_a_zone_lies_under_a_body_as_long_as_three_edges():
    """The share of a body over a step grows in proportion; its zone is so within 0.07."""
    body, at = 0.06, np.linspace(-0.1, 0.4, 501)
    edge = {"zone_start": np.array(0.1), "zone_length": np.array(0.15), "zone_edge": body / 3}
    theta = {name: np.asarray(value) for name, value in edge.items()}
    over = [np.clip((at - start) / body + 0.5, 0.0, 1.0) for start in (0.1, 0.25)]
    assert share_inside(at, "zone", theta) == pytest.approx(over[0] - over[1], abs=0.07)


@settings(max_examples=15)
@given(release=st.floats(0.3, 1.0), rougher=st.floats(0.0, 0.5))
def test_friction_patch_takes_its_work(release, rougher):
    """Without other friction v^2 / 2 falls by dk g L; what has less than that stops within."""
    experiment = replace(LONG_TABLE, release_m=release)
    x, speed = on_table(move(experiment, {"friction_patch": rougher} | PATCH))
    had, work = 0.5 * speed[0] ** 2, rougher * G * 0.1
    if work < 0.9 * had:
        assert x[-1] > 0.35
        assert had - 0.5 * speed[-1] ** 2 == pytest.approx(work, rel=ZONE_RTOL, abs=ZONE_ATOL)
    elif work > 1.1 * had:
        assert x[-1] < CORNER_M + 0.31 and speed[-1] == 0.0


@pytest.mark.parametrize("rougher", [-0.05, -0.5])
def test_smooth_patch_is_at_best_without_friction(rougher):
    rough = replace(LONG_TABLE, friction=(0.1, 0.0), release_m=0.6)
    zone = {"start": 0.1, "length": 0.2, "edge": 0.005}
    given = {"friction_patch": rougher} | {f"friction_patch_{k}": v for k, v in zone.items()}
    x, speed = on_table(move(rough, given))
    inside = (x > CORNER_M + 0.15) & (x < CORNER_M + 0.25)
    loss = np.diff(speed[inside] ** 2) / np.diff(x[inside]) / 2
    assert loss == pytest.approx(-max(0.0, 0.1 + rougher) * G, abs=1e-6)


@pytest.mark.parametrize("edge", [0.01, 0.025])
def test_soft_edges_take_the_same_work(edge):
    x, speed = on_table(
        move(LONG_TABLE, {"friction_patch": 0.2} | PATCH | {"friction_patch_edge": edge})
    )
    assert x[-1] > 0.4
    assert 0.5 * (speed[0] ** 2 - speed[-1] ** 2) == pytest.approx(0.2 * G * 0.1, rel=ZONE_RTOL)


def test_friction_patch_brakes_whatever_slides_over_it():
    """Object 2, which is hit before the strip, loses dk g L in it as object 1 would."""
    experiment = replace(HIT, friction=(0.2, 0.0), release_m=1.2)
    strip = {"friction_patch": 0.3, "friction_patch_start": 0.4, "friction_patch_length": 0.1}
    motion, plain = move(experiment, strip), move(experiment)
    assert motion.position_m[1, 0, -1] > CORNER_M + 0.55 > motion.position_m[0, 0, -1] + 0.1
    lost = 0.5 * (plain.speed_m_s[1, -1] ** 2 - motion.speed_m_s[1, -1] ** 2)
    assert lost == pytest.approx(0.3 * G * 0.1, rel=ZONE_RTOL, abs=ZONE_ATOL)


@pytest.mark.parametrize(("rougher", "k"), [(0.1, 0.2), (-0.05, 0.05), (-0.5, 0.0)])
def test_surface_friction_is_of_the_table(rougher, k):
    rough = replace(LONG_TABLE, friction=(0.1, 0.0))
    motion = move(rough, {"surface_friction": rougher})
    plain = move(rough)
    up = plain.position_m[0, 0] < 0
    assert motion.position_m[..., up] == pytest.approx(plain.position_m[..., up], abs=EXACT)
    _, speed = on_table(motion)
    moving = speed[speed > 0][:-1]
    assert np.diff(moving) == pytest.approx(-k * G * motion.times_s[1], abs=EXACT)


@settings(max_examples=15)
@given(release=st.floats(0.35, 1.0), b=st.floats(0.1, 4.0), mass=st.floats(0.2, 2.0))
def test_magnetic_brake_takes_the_same_from_every_speed(release, b, mass):
    """dv/dq = -b / m: what passes has lost b L / m; what cannot stops within."""
    experiment = replace(LONG_TABLE, release_m=release, mass_kg=(mass, 0.3))
    motion = move(experiment, {"magnetic_brake": b} | BRAKE)
    x, speed = on_table(motion)
    lost = b * 0.1 / mass
    if lost < 0.8 * speed[0]:
        assert x[-1] > 0.35
        assert speed[0] - speed[-1] == pytest.approx(lost, rel=ZONE_RTOL, abs=ZONE_ATOL)
    elif lost > 1.1 * speed[0]:
        assert x[-1] < CORNER_M + 0.31


@pytest.mark.parametrize("stiffness", [2.0, 10.0])
def test_spring_tether_is_harmonic(stiffness):
    smooth = replace(LONG_RAMP, friction=(0.0, 0.0))
    motion = move(smooth, {"spring_tether": stiffness})
    omega = math.sqrt(stiffness / M1)
    amplitude = G * math.sin(ANGLE) / omega**2
    expected = amplitude * (1 - np.cos(omega * motion.times_s))
    assert motion.gone_m[0] == pytest.approx(expected, abs=5e-4 * amplitude)


@pytest.mark.parametrize("straightness", [0.0, 0.4, 1.0])
def test_a_straight_band_pulls_to_its_start_and_lifts(straightness):
    """On the table, by the geometry of the plane; on the ramp along it."""
    scene, (band,) = PAIR, make_effects(["spring_tether"])
    stiffness, mass, k = 3.0, 0.4, 0.2
    given = {"spring_tether": stiffness, "spring_tether_straightness": straightness}
    theta = {name: np.asarray(value) for name, value in {**given, "m1": mass, "m2": 0.3}.items()}
    start, slope = scene.start_path_m[0], scene.angle_rad
    force, law = band.force(theta, scene), band.friction(theta, scene)
    assert force is not None and law is not None
    on_table, on_ramp = (
        State(np.array([q, 0.5]), np.array([0.7, 0.0]), np.asarray(0.3), np.array([q < 0, False]))
        for q in (0.2, 0.4 * start)
    )
    coefficients = np.array([k, k])
    gone = np.array([0.2 - start * np.cos(slope), start * np.sin(slope)])  # of r - r_start
    straight, along = -stiffness * gone[0], -stiffness * (0.2 - start)
    expected = straightness * straight + (1 - straightness) * along
    assert force(on_table) == pytest.approx(np.array([expected, 0.0]))
    lifted = straightness * -stiffness * gone[1] / (mass * scene.gravity)
    assert lifted >= 0.0
    assert law(on_table, coefficients) == pytest.approx(np.array([k * (1 - lifted), k]))
    assert force(on_ramp) == pytest.approx(np.array([stiffness * 0.6 * start, 0.0]))
    assert law(on_ramp, coefficients) == pytest.approx(coefficients)


def test_stribeck_friction_is_that_of_all_objects():
    (law,) = make_effects(["stribeck"])
    theta = {"stribeck": np.asarray(1.5), "stribeck_speed": np.asarray(0.4)}
    friction = law.friction(theta, PAIR)
    assert friction is not None
    speed, k = np.array([0.8, -0.2]), np.array([0.1, 0.3])
    state = State(np.array([0.1, 0.3]), speed, np.asarray(0.0), np.array([False, False]))
    assert friction(state, k) == pytest.approx(k * (1 + 1.5 * np.exp(-np.abs(speed) / 0.4)))
