"""The rigid engine: exact where there is a closed form, and right where there is none."""

import math
from dataclasses import replace

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from galileo_jax.model.effects.effect import Effect
from galileo_jax.model.model import Model
from galileo_jax.model.parameters import PriorTable, inverse
from galileo_jax.rollout.engine_path import EnginePath, roll_out
from galileo_jax.rollout.motion import LEAST_FRICTION
from galileo_jax.rollout.rollout import JUMP_M_S2, Trajectory, at_times
from tests.ramp_model import HIT, make_model, make_theta
from tests.reference_ramp import Experiment, solve
from tests.rollout.rolled import derivatives, rolled
from tests.rollout.simple_effects import EVERY_KIND, Drag, Spring, Stribeck, Wind

CLOSED_FORM_ATOL = 1e-9  # m and m/s; 1e-14 is typical
EXACT_RTOL = 1e-9
ROUNDING_M = 1e-12  # one program for each size of a batch
STEP_Z, REACH_S = 0.01, 0.015
SLOPE_RTOL = 1e-3
HALVING_ATOL_M_S = 5e-4
# Between records a jump's time is known from places alone, as well as they are curved.
AT_TIMES_ATOL_M = 1e-4
FINE_S, FINE_ATOL_M = 2e-5, 5e-4
# As smooth as the package lets a surface be.
SMOOTH = replace(HIT, friction=(LEAST_FRICTION, LEAST_FRICTION))


def simulate(experiment, duration_s, effects: tuple[Effect, ...] = (), **given):
    """Centres and velocities of one rollout, its times, and its model."""
    model = replace(make_model(experiment, duration_s), effects=effects)
    position, velocity = EnginePath(model).simulate(make_theta(model, experiment, given)[None])
    times = np.arange(position.shape[-1]) * model.record_dt_s
    return position[0], velocity[0], times


def random_experiment(seed: int) -> Experiment:
    """Any angle, sizes, masses and frictions, whether object 1 slides and hits or not."""
    rng = np.random.default_rng(seed)
    angle = math.radians(rng.uniform(5, 40))
    sizes = rng.uniform(0.02, 0.1, (2, 2))
    return Experiment(
        mass_kg=tuple(rng.uniform(0.05, 2.0, 2)),
        friction=(rng.uniform(0.01, 1.2 * math.tan(angle)), rng.uniform(0.01, 0.8)),
        angle_rad=angle,
        size_m=(tuple(sizes[0]), tuple(sizes[1])),
        release_m=rng.uniform(0.1, 0.8),
        object2_x_m=rng.uniform(0.15, 0.5),
    )


@pytest.mark.parametrize("seed", range(20))
def test_follows_the_closed_form(seed):
    experiment = random_experiment(seed)
    position, velocity, times = simulate(experiment, 3.0)
    exact = solve(experiment, times)
    assert position == pytest.approx(exact.position_m, abs=CLOSED_FORM_ATOL)
    assert velocity == pytest.approx(exact.velocity_m_s, abs=CLOSED_FORM_ATOL)


def test_the_draws_above_show_everything():
    """Some are hit and some are not; some push and some part; some do not even slide."""
    experiments = [random_experiment(seed) for seed in range(20)]
    solved = [solve(one, np.zeros(1)) for one in experiments]
    hits = [one for one, found in zip(experiments, solved, strict=True) if found.hit_s]
    assert 5 <= len(hits) < 20
    assert {one.friction[0] < one.friction[1] for one in hits} == {True, False}
    assert any(found.foot_s is None for found in solved)


def speeds_at_the_hit(mass, **given):
    """Of both bodies before and after it, and what friction takes between two records."""
    experiment = replace(SMOOTH, mass_kg=mass)
    hit = solve(experiment, np.zeros(1)).hit_s
    assert hit
    _, velocity, times = simulate(experiment, hit + 0.02, **given)
    rubbed = 2 * 9.81 * LEAST_FRICTION * (times[1] - times[0])
    return velocity[:, 0, times < hit][:, -1], velocity[:, 0, times > hit][:, 0], rubbed


@pytest.mark.parametrize("wanted", [0.0, 0.01, 0.3, 0.95])
@pytest.mark.parametrize("mass", [(0.5, 0.3), (0.2, 0.9), (1.0, 1.0)])
def test_restitution_and_momentum(wanted, mass):
    before, after, rubbed = speeds_at_the_hit(mass, impact_restitution=wanted)
    assert after[1] - after[0] == pytest.approx(wanted * before[0], abs=rubbed)
    assert np.dot(mass, after) == pytest.approx(np.dot(mass, before), abs=rubbed)


@pytest.mark.parametrize("factor", [0.98, 1.0, 1.02])
@pytest.mark.parametrize("mass", [(0.4, 0.3), (0.1, 2.0)])
def test_a_hit_passes_on_so_much_of_what_the_rear_body_loses(factor, mass):
    before, after, rubbed = speeds_at_the_hit(mass, impact_momentum_object2=factor)
    lost, gained = mass[0] * (before[0] - after[0]), mass[1] * (after[1] - before[1])
    assert gained == pytest.approx(factor * lost, abs=rubbed)


@pytest.mark.parametrize("further", [0.0, 0.002])
def test_bodies_that_meet_again_touch_further_apart(further):
    """The front one, rougher, is caught up with: at so much more distance than at the hit."""
    given = {"impact_restitution": 0.08, "contact_gap": further}
    position, _, _ = simulate(HIT, 2.0, **given)
    gap = position[1, 0] - position[0, 0] - HIT.size_m[0][0] / 2 - HIT.size_m[1][0] / 2
    assert gap.min() == pytest.approx(0.0, abs=5e-3), "the hit itself, between two records"
    assert gap.max(where=position[1, 0] > HIT.object2_x_m, initial=0.0) > 0.003
    assert gap[-1] == pytest.approx(further, abs=1e-6)


@pytest.mark.parametrize("factor", [0.9, 0.95, 1.05])
def test_foot_transition_is_the_factor_on_the_speed(factor):
    experiment = replace(SMOOTH, object2_x_m=0.6)
    foot = solve(experiment, np.zeros(1)).foot_s
    assert foot
    speeds = []
    for given in (1.0, factor):
        _, velocity, times = simulate(experiment, foot + 0.02, foot_transition=given)
        now = np.flatnonzero(times > foot)[0]
        # What little friction has taken since the foot is given back.
        speeds.append(velocity[0, 0, now] + LEAST_FRICTION * 9.81 * (times[now] - foot))
    assert speeds[1] / speeds[0] == pytest.approx(factor, rel=EXACT_RTOL)


@pytest.mark.parametrize("angle_deg", [5, 20, 40])
@pytest.mark.parametrize("share", [1.0001, 2.0])
def test_nothing_moves_above_the_friction_angle(angle_deg, share):
    angle = math.radians(angle_deg)
    experiment = replace(HIT, angle_rad=angle, friction=(share * math.tan(angle), 0.2))
    position, velocity, _ = simulate(experiment, 2.0)
    assert (position == position[..., :1]).all()
    assert (velocity == 0).all()


def test_derivatives_are_those_of_the_motion():
    """Every parameter's, effects' too, against central differences of plain rollouts."""
    model = replace(make_model(HIT, 1.2), effects=(Drag(), Stribeck()))
    theta = make_theta(
        model, HIT, {"impact_restitution": 0.05, "contact_gap": 3e-4, "drag": 0.05, "stribeck": 0.3}
    )
    z = inverse(model.parameters, jnp.asarray(theta))
    engine = EnginePath(model)
    # No frame within the steps' reach of the foot or the hit, where a difference sees both
    # sides and the derivative one.
    speed = np.asarray(rolled(engine, z).velocity_m_s)
    jumps = np.flatnonzero(np.abs(np.diff(speed)).max(axis=(0, 1)) > JUMP_M_S2 * model.record_dt_s)
    times = np.arange(1, 36) / 30
    away = np.abs(times[:, None] - jumps * model.record_dt_s).min(axis=1) > REACH_S
    times = jnp.asarray(times[away])
    assert len(jumps) == 2 and len(times) > 30

    slopes, differences = derivatives(engine, z, times, STEP_Z)
    for i, parameter in enumerate(model.parameters):
        wanted = differences[i]
        if parameter.step is None:
            assert (wanted == 0).all() and (slopes[..., i] == 0).all()
            continue
        error = np.linalg.norm(slopes[..., i] - wanted) / np.linalg.norm(wanted)
        assert error < SLOPE_RTOL, f"{parameter.name}: {error}"


def test_absent_nuisances_are_not_there():
    model = make_model(HIT, 1.2)
    bare = Model(model.scene, model.duration_s, nuisances=())
    found = EnginePath(model).simulate(make_theta(model, HIT)[None])
    wanted = EnginePath(bare).simulate(make_theta(bare, HIT)[None])
    assert (found[0] == wanted[0]).all() and (found[1] == wanted[1]).all()


@pytest.mark.parametrize("effect", EVERY_KIND, ids=lambda effect: effect.name)
def test_absent_effects_are_not_there(effect):
    plain = simulate(HIT, 1.2)
    absent = simulate(HIT, 1.2, (effect,))
    # Without laws motions are computed from event to event, with them step by step.
    assert absent[0] == pytest.approx(plain[0], abs=ROUNDING_M)
    assert absent[1] == pytest.approx(plain[1], abs=ROUNDING_M)


def test_a_result_does_not_depend_on_its_batch():
    model = make_model(HIT, 1.2)
    engine, theta = EnginePath(model), make_theta(model, HIT)
    rng = np.random.default_rng(0)
    batch = theta * (1 + 0.1 * rng.uniform(-1, 1, (70, len(theta))))
    together = engine.simulate(batch)[0]
    for count in (1, 2, 7):
        assert engine.simulate(batch[:count])[0] == pytest.approx(together[:count], abs=ROUNDING_M)


def test_bad_parameters_spoil_only_their_own_rollout():
    model = make_model(HIT, 1.2)
    engine, theta = EnginePath(model), np.tile(make_theta(model, HIT), (3, 1))
    theta[1, 0] = np.nan
    position, velocity = engine.simulate(theta)
    assert np.isnan(position[1]).any() and np.isnan(velocity[1]).any()
    alone, _ = engine.simulate(theta[:1])
    assert position[0] == pytest.approx(alone[0], abs=ROUNDING_M)
    assert (position[0] == position[2]).all()


def fine_steps(experiment, times, restitution, spring=0.0, drag=0.0, wind=0.0):
    """x of both objects `[object, time]` by small steps: nothing here knows of events.

    On the table and the ramp, with impacts wherever faces have met; friction that would turn
    the motion round stops it.
    """
    angle, g = experiment.angle_rad, experiment.gravity
    mass, k = np.array(experiment.mass_kg), np.array(experiment.friction)
    corner = experiment.size_m[0][1] / 2 * math.tan(angle / 2)
    corner2 = experiment.size_m[1][1] / 2 * math.tan(angle / 2)
    m1, m2, k1, k2 = (*mass, *k)
    q1, q2, v1, v2 = corner - experiment.release_m, experiment.object2_x_m - corner2, 0.0, 0.0
    reach = (experiment.size_m[0][0] + experiment.size_m[1][0]) / 2 + corner - corner2
    kept = math.cos(angle) - k1 * math.sin(angle)
    pull, normal = math.sin(angle), math.cos(angle)
    found, h = np.empty((2, len(times))), FINE_S

    def pushed(v, a, brake):
        free = v + a * h
        return math.copysign(max(abs(free) - brake * h, 0.0), free)

    step = 0
    for i, until in enumerate(times):
        while step * h < until - h / 2:
            step += 1
            was_on_ramp = q1 < 0
            force = -wind - spring * q1 - drag * v1 * (1 + abs(v1))
            v1 = pushed(
                v1,
                force / m1 + (g * pull if was_on_ramp else 0.0),
                k1 * g * (normal if was_on_ramp else 1.0),
            )
            v2 = pushed(v2, -drag * v2 * (1 + abs(v2)) / m2, k2 * g)
            q1, q2 = q1 + v1 * h, q2 + v2 * h
            if (q1 < 0) != was_on_ramp:
                v1 *= kept
            overlap = q1 + reach - q2
            if overlap > 0:
                q1, q2 = q1 - overlap * m2 / (m1 + m2), q2 + overlap * m1 / (m1 + m2)
                approach = v1 - v2
                if approach > 0:
                    e = restitution if approach > 0.02 else 0.0
                    common = (m1 * v1 + m2 * v2) / (m1 + m2)
                    v1 = common - e * approach * m2 / (m1 + m2)
                    v2 = common + e * approach * m1 / (m1 + m2)
        x1 = q1 * (math.cos(angle) if q1 < 0 else 1.0)
        found[:, i] = x1 + corner, q2 + corner2
    return found


EVENTFUL = {
    # Object 2 brakes hard and is knocked on again and again.
    "bounces": (replace(HIT, mass_kg=(1.0, 0.3), friction=(0.02, 0.8)), 0.95, {}),
    # Object 1 is thrown back, up the ramp, and comes down again.
    "returns": (replace(HIT, mass_kg=(0.1, 1.0), friction=(0.01, 0.3)), 0.9, {}),
    # A spring about the foot: back and forth across it until friction wins.
    "swings": (
        replace(HIT, mass_kg=(0.5, 0.5), friction=(0.05, 0.3), object2_x_m=0.6),
        0.5,
        {"spring": 8.0},
    ),
    # The wind keeps object 1 in the corner, from which both sides lead up.
    "corner": (
        replace(
            HIT,
            angle_rad=math.radians(35),
            mass_kg=(0.3, 0.3),
            friction=(0.01, 0.02),
            release_m=0.3,
            object2_x_m=0.1,
        ),
        0.3,
        {"wind": 0.8},
    ),
    "rubs along": (replace(HIT, friction=(0.05, 0.3)), 0.0, {"drag": 0.2}),
}


@pytest.mark.parametrize("case", EVENTFUL)
def test_many_events(case):
    experiment, restitution, given = EVENTFUL[case]
    position, _, times = simulate(
        experiment, 3.0, (Drag(), Spring(), Wind()), impact_restitution=restitution, **given
    )
    fine = fine_steps(experiment, times, restitution, **given)
    assert position[:, 0] == pytest.approx(fine, abs=FINE_ATOL_M)


@pytest.mark.parametrize("case", ["bounces", "returns"])
def test_energy_never_grows(case):
    experiment, restitution, _ = EVENTFUL[case]
    for e in (0.0, restitution):
        position, velocity, _ = simulate(experiment, 4.0, impact_restitution=e)
        mass = np.array(experiment.mass_kg)[:, None]
        kinetic = 0.5 * mass * (velocity**2).sum(axis=1)
        energy = (kinetic + mass * 9.81 * position[:, 1]).sum(axis=0)
        assert np.diff(energy).max() <= 1e-12
        gap = position[1, 0] - position[0, 0] - 0.06
        assert gap.min() > -1e-9, "nothing passes through anything"


@pytest.mark.parametrize("strength", [0.05, 0.5])
def test_halving_the_steps(strength):
    model = replace(make_model(HIT, 1.4), effects=(Drag(), Stribeck()))
    theta = jnp.asarray(make_theta(model, HIT, {"drag": strength, "stribeck": 0.5}))
    effects, scene = model.effects + model.nuisances, model.scene.surroundings
    count, dt = model.num_records, model.record_dt_s
    coarse = roll_out(effects, model.names, count, dt, theta, scene)[1]
    halved = roll_out(effects, model.names, 2 * count, dt / 2, theta, scene)[1][..., ::2]
    assert np.abs(coarse - halved).max() < HALVING_ATOL_M_S


@pytest.mark.parametrize("seed", range(5))
def test_at_times_between_records(seed):
    experiment = random_experiment(seed)
    position, velocity, times = simulate(experiment, 2.0)
    asked = np.sort(np.random.default_rng(seed).uniform(0, 2.0, 3000))
    motion = Trajectory(*(jnp.asarray(a) for a in (times, position, velocity)))
    found, _ = at_times(motion, jnp.asarray(asked))
    assert np.asarray(found) == pytest.approx(
        solve(experiment, asked).position_m, abs=AT_TIMES_ATOL_M
    )


def test_parameters_outside_jit_and_inside_are_one_path():
    model = make_model(HIT, 0.5)
    z = inverse(model.parameters, jnp.asarray(make_theta(model, HIT)))
    engine = EnginePath(model)
    by_call, _ = engine.simulate(
        np.asarray(PriorTable.of(model.parameters).forward(jnp.asarray(z)))[None]
    )
    traced = jax.jit(lambda z: rolled(engine, z).position_m)(z)
    assert np.asarray(traced) == pytest.approx(by_call[0], abs=CLOSED_FORM_ATOL)
