"""Every nuisance does what it says, and nothing at its absent value."""

from dataclasses import replace

import numpy as np
import pytest

from galileo_jax.effects.effect import State, Surroundings
from galileo_jax.effects.nuisances import NUISANCES
from galileo_jax.effects.nuisances.foot_transition import ZONE_M, FootTransition
from galileo_jax.effects.nuisances.pixel_scale import PixelScale
from galileo_jax.effects.nuisances.release_instant import ReleaseInstant
from galileo_jax.effects.nuisances.start_offset import StartOffset
from galileo_jax.observation import NOMINAL_SCALE_PX_PER_M
from galileo_jax.rollout.engine_c import EngineC
from tests.ramp_model import HIT, SMOOTH, make_model, make_surroundings, make_theta

FACTOR_ATOL = 0.004  # the zone is crossed in some 17 ms, in steps of 4 ms
RAMP = make_surroundings(HIT)
INCLINE: Surroundings = replace(
    make_surroundings(replace(HIT, object2_x_m=None)), corner_m=(float("inf"),)
)


def absent_theta(effect, scene, **given):
    values = {p.name: np.array([p.absent]) for p in effect.parameters(scene)}
    values |= {"m1": np.array([0.5]), "m2": np.array([0.3])}
    return values | {name: np.array([value]) for name, value in given.items()}


@pytest.mark.parametrize("effect", NUISANCES, ids=lambda effect: effect.name)
@pytest.mark.parametrize("scene", [RAMP, INCLINE], ids=["ramp", "incline"])
def test_absent_is_nothing(effect, scene):
    """Tests exact equality: a richer model contains the poorer one."""
    theta = absent_theta(effect, scene)
    count = len(scene.names)
    position = np.random.default_rng(0).normal(size=(1, count, 2))
    assert (effect.start(position, theta, scene) == position).all()
    frames = np.linspace(0, 1, 7)
    assert (effect.time(frames, theta, scene) == frames).all()
    track = np.random.default_rng(1).normal(size=(count, 2, 7))
    assert effect.measure(track, theta, scene) == pytest.approx(track, abs=0)
    force = effect.force(theta, scene)
    if force is not None:
        here = np.array([[[scene.corner_m[0] + ZONE_M / 2, 0.03]] * count])
        assert (force(State(here, np.ones_like(here), np.array(0.0))) == 0).all()
    restitution = effect.restitution(theta, scene)
    assert restitution is None or (restitution == 0).all()


@pytest.mark.parametrize("effect", NUISANCES, ids=lambda effect: effect.name)
def test_names_and_roles(effect):
    for parameter in effect.parameters(RAMP):
        assert parameter.role == "nuisance"
    names = [p.name for p in effect.parameters(RAMP)]
    assert len(set(names)) == len(names)


@pytest.mark.parametrize("factor", [0.9, 0.95, 1.05])
@pytest.mark.parametrize("release_m", [0.15, 0.5])
def test_foot_transition_is_the_factor_on_the_speed(factor, release_m):
    experiment = replace(SMOOTH, release_m=release_m, object2_x_m=0.6)
    engine = EngineC(make_model(experiment, 1.0))
    theta = np.stack(
        [make_theta(engine.model, experiment, {"foot_transition": f}) for f in (1.0, factor)]
    )
    position, velocity = engine.simulate(theta)
    beyond = position[:, 0, 0] > ZONE_M + 0.03
    plain, changed = (v[0, 0][np.argmax(b)] for v, b in zip(velocity, beyond, strict=True))
    assert changed / plain == pytest.approx(factor, abs=FACTOR_ATOL)


def test_foot_transition_only_of_what_comes_down():
    force = FootTransition().force(absent_theta(FootTransition(), RAMP, foot_transition=0.9), RAMP)
    assert force is not None
    here = np.full((1, 2, 2), ZONE_M / 2)
    pushed = force(State(here, np.ones_like(here), np.array(0.0)))
    assert pushed[0, 0, 0] < 0 and (pushed[0, 1] == 0).all() and (pushed[..., 1] == 0).all()


def test_start_offset_is_along_the_surface():
    start = np.asarray(RAMP.start_m)[None]
    theta = absent_theta(
        StartOffset(), RAMP, start_offset_object1=0.004, start_offset_object2=-0.002
    )
    moved = (StartOffset().start(start, theta, RAMP) - start)[0]
    along = np.array([np.cos(RAMP.angle_rad), -np.sin(RAMP.angle_rad)])
    assert moved[0] == pytest.approx(0.004 * along)
    assert moved[1] == pytest.approx([-0.002, 0.0])


def test_release_instant_shifts_the_clock():
    theta = absent_theta(ReleaseInstant(), RAMP, release_instant=0.02)
    shifted = ReleaseInstant().time(np.array([0.0, 0.5]), theta, RAMP)
    assert shifted == pytest.approx([-0.02, 0.48])


def test_pixel_scale_only_where_it_is_unknown():
    assert PixelScale().parameters(RAMP) == ()
    unknown = replace(INCLINE, is_scale_known=False)
    (parameter,) = PixelScale().parameters(unknown)
    assert parameter.name == "pixels_per_metre"
    position = np.array([[[0.1, 0.3], [0.2, 0.1]]])
    twice = PixelScale().measure(
        position, {"pixels_per_metre": 2 * NOMINAL_SCALE_PX_PER_M}, unknown
    )
    start = np.asarray(unknown.start_m[0])[:, None]
    assert twice[0] - start == pytest.approx(2 * (position[0] - start))
