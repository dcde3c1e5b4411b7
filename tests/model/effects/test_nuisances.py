"""Every nuisance does what it says, and nothing at its absent value."""

from dataclasses import replace

import numpy as np
import pytest

from galileo_jax.model.effects.effect import Surroundings
from galileo_jax.model.effects.nuisances import NUISANCES
from galileo_jax.model.effects.nuisances.declared import DeclaredAngle, DeclaredScale
from galileo_jax.model.effects.nuisances.foot_transition import FootTransition
from galileo_jax.model.effects.nuisances.pixel_scale import PixelScale
from galileo_jax.model.effects.nuisances.release_instant import ReleaseInstant
from galileo_jax.model.effects.nuisances.start_offset import StartOffset
from galileo_jax.model.parameters import Normal
from galileo_jax.numerics.units import NOMINAL_SCALE_PX_PER_M
from tests.ramp_model import HIT, make_surroundings

RAMP = make_surroundings(HIT)
INCLINE: Surroundings = replace(
    make_surroundings(replace(HIT, object2_x_m=None)),
    corner_m=(float("inf"),),
    has_table=False,
    comes_down=(False,),
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
    path = np.random.default_rng(0).normal(size=(1, count))
    assert (effect.start(path, theta, scene) == path).all()
    frames = np.linspace(0, 1, 7)
    assert (effect.time(frames, theta, scene) == frames).all()
    track = np.random.default_rng(1).normal(size=(count, 2, 7))
    assert effect.measure(track, theta, scene) == pytest.approx(track, abs=0)
    for hook in (effect.force, effect.friction, effect.inertia, effect.tilt, effect.start_speed):
        assert hook(theta, scene) is None
    foot = effect.foot(theta, scene)
    assert foot is None or (foot == 1).all()
    for hook in (effect.restitution, effect.overlap):
        found = hook(theta, scene)
        assert found is None or (found == 0).all()


@pytest.mark.parametrize("effect", NUISANCES, ids=lambda effect: effect.name)
def test_names_and_roles(effect):
    for parameter in effect.parameters(RAMP):
        assert parameter.role == "nuisance"
    names = [p.name for p in effect.parameters(RAMP)]
    assert len(set(names)) == len(names)


@pytest.mark.parametrize("nuisance", [FootTransition(), StartOffset()])
def test_the_foot_and_marks_are_of_a_ramp_with_a_table(nuisance):
    assert nuisance.parameters(RAMP) and not nuisance.parameters(INCLINE)


def test_foot_transition_is_the_factor_at_the_foot():
    theta = absent_theta(FootTransition(), RAMP, foot_transition=0.9)
    assert FootTransition().foot(theta, RAMP) == pytest.approx([0.9])
    still = replace(RAMP, comes_down=(False, False))
    assert FootTransition().parameters(still) == (), "nothing comes down"


@pytest.mark.parametrize("degrees", [5.0, 15.0, 30.0])
def test_a_foot_that_takes_no_speed_is_not_out_of_the_question(degrees):
    """Of a body with half the friction that would hold it on the ramp."""
    angle = np.radians(degrees)
    (factor,) = FootTransition().parameters(replace(RAMP, angle_rad=angle))
    keeps_all = 1 / (np.cos(angle) - 0.5 * np.tan(angle) * np.sin(angle))
    assert isinstance(factor.prior, Normal)
    assert 0.05 <= factor.prior.sd < 0.25
    assert keeps_all - 1 <= 2 * factor.prior.sd


def test_start_offset_is_along_the_path():
    theta = absent_theta(
        StartOffset(), RAMP, start_offset_object1=0.004, start_offset_object2=-0.002
    )
    start = np.asarray(RAMP.start_path_m)[None]
    moved = (StartOffset().start(start, theta, RAMP) - start)[0]
    assert moved == pytest.approx([0.004, -0.002])


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


@pytest.mark.parametrize("scene", [RAMP, INCLINE], ids=["ramp", "incline"])
def test_a_declared_scale_that_is_off_lengthens_what_is_measured(scene):
    doubted = replace(scene, expected={"declared_scale": (0.0, 0.004)})
    scale, theta = DeclaredScale(), {"declared_scale": np.array([0.01])}
    assert scale.parameters(scene) == ()
    (parameter,) = scale.parameters(doubted)
    assert (parameter.role, parameter.prior.encode()) == ("nuisance", (0, 0.0, 0.004))
    count = len(scene.names)
    begun = np.full((1, count), -0.202)
    assert scale.start(begun, theta, doubted) == pytest.approx(begun / 1.01)
    moved = np.zeros((count, 2, 2))
    moved[:, 0] = [0.1, 0.3]
    seen = scale.measure(moved, {"declared_scale": 0.01}, doubted)
    assert np.diff(seen[:, 0]) == pytest.approx(0.202)


def test_an_origin_that_is_hardly_known_widens_the_starts():
    parameters = StartOffset().parameters(replace(RAMP, expected={"origin_m": (0.0, 0.004)}))
    assert [parameter.prior.encode() for parameter in parameters] == [(0, 0.0, 0.005)] * 2


def test_an_angle_that_is_known_within_tenths_may_be_steeper():
    known, doubted = DeclaredAngle(), replace(INCLINE, expected={"declared_angle": (0.0, 0.005)})
    assert known.parameters(INCLINE) == ()
    (parameter,) = known.parameters(doubted)
    assert (parameter.role, parameter.prior.encode()) == ("nuisance", (0, 0.0, 0.005))
    ramp, table = known.tilt({"declared_angle": np.array([0.01])}, doubted) or (None, None)
    assert ramp == pytest.approx([0.01]) and table == pytest.approx([0.0])
