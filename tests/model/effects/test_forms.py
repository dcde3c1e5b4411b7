"""Forms without a name: in no list of names, nothing at absent, and what they do when present."""

from dataclasses import replace

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from galileo_jax.model.effects import effect_names
from galileo_jax.model.effects.effect import State
from galileo_jax.model.effects.forms import FORM_NAMES, FORMS
from galileo_jax.model.effects.registry import make_effects
from galileo_jax.rollout.motion import dynamics
from tests.model.effects.motion import INCLINE, PAIR

K = np.array([0.2, 0.3])
STATE = State(np.array([-0.3, 0.1]), np.array([0.5, 0.2]), np.asarray(0.4), np.array([True, False]))


def theta(**given):
    found = {p.name: np.asarray(p.absent) for form in FORMS for p in form.parameters(PAIR)}
    masses = {"m1": np.asarray(0.5), "m2": np.asarray(0.25)}
    return found | masses | {name: np.asarray(value) for name, value in given.items()}


def named(name):
    return next(form for form in FORMS if form.name == name)


def friction(form, **given):
    law = named(form).friction(theta(**given), PAIR)
    assert law is not None
    return law


def push(form, **given):
    force = named(form).force(theta(**given), PAIR)
    assert force is not None
    return force


def test_they_have_no_place_among_the_names():
    assert not set(FORM_NAMES) & set(effect_names())


def test_a_form_is_as_probable_as_an_effect_but_a_drag_with_a_name_is_more():
    odds = {form.name: form.odds(theta(), PAIR) for form in FORMS}
    assert odds.pop("drag_of_a_power") == 0.05
    assert set(odds.values()) == {1.0}


@pytest.mark.parametrize("form", FORMS, ids=FORM_NAMES)
def test_parameters(form):
    strength, *others = form.parameters(PAIR)
    assert strength.name == form.name and strength.absent == 0.0
    assert all(p.name.startswith(f"{form.name}_") for p in others)
    assert all(p.role == "effect" for p in (strength, *others))


def test_friction_grows_with_time():
    law = friction("friction_with_time", friction_with_time=0.5)
    assert law(STATE, K) == pytest.approx(K * 1.2)


def test_friction_grows_with_place_and_is_never_negative():
    law = friction("friction_with_place", friction_with_place=2.0)
    assert law(STATE, K) == pytest.approx(K * [0.4, 1.2])
    assert (law(STATE._replace(path_m=np.array([-0.6, 0.1])), K) >= 0).all()


def test_friction_waves_in_place():
    law = friction(
        "friction_waves_in_place",
        friction_waves_in_place=0.05,
        friction_waves_in_place_later=0.02,
        friction_waves_in_place_length=0.4,
    )
    # Three quarters of a wave before the foot, and a quarter past it.
    assert law(STATE, K) == pytest.approx(K + 0.02)


def test_force_waves_in_time():
    force = push("force_waves_in_time", force_waves_in_time=1.5, force_waves_in_time_period=0.4)
    assert force(STATE) == pytest.approx(np.array([0.5, 0.25]) * 1.5)
    assert force(STATE._replace(time_s=0.6)) == pytest.approx(np.array([0.5, 0.25]) * -1.5)


def test_friction_from_a_time():
    law = friction(
        "friction_from_a_time", friction_from_a_time=0.1, friction_from_a_time_moment=0.4
    )
    before, middle, after = (law(STATE._replace(time_s=np.asarray(t)), K) for t in (0.2, 0.4, 0.6))
    np.testing.assert_allclose(before, K, atol=1e-8)
    np.testing.assert_allclose(middle, K + np.array([0.05, 0.0]), atol=1e-8)
    np.testing.assert_allclose(after, K + np.array([0.1, 0.0]), atol=1e-8)
    law = friction(
        "friction_from_a_time", friction_from_a_time=-0.5, friction_from_a_time_moment=0.0
    )
    np.testing.assert_allclose(law(STATE, K), [0.0, 0.3], atol=1e-8)


def test_force_at_a_time():
    force = push(
        "force_at_a_time",
        force_at_a_time=2.0,
        force_at_a_time_moment=0.3,
        force_at_a_time_duration=0.1,
    )
    assert force(STATE) == pytest.approx(np.array([0.5 * 2.0 * np.exp(-1.0), 0.0]))


@pytest.mark.parametrize(("power", "law"), [(1.0, "viscous_drag"), (2.0, "air_drag")])
def test_drags_of_the_library_are_of_a_power(power, law):
    named = next(effect for effect in make_effects([law]))
    expected = named.force({law: np.asarray(0.4)}, PAIR)
    assert expected is not None
    found = push("drag_of_a_power", drag_of_a_power=0.4, drag_of_a_power_power=power)
    for speed in (np.array([0.5, 2.0]), np.array([-1.0, 0.0])):
        state = STATE._replace(speed_m_s=speed)
        assert found(state) == pytest.approx(expected(state), rel=1e-3)


def test_a_root_drag():
    force = push("drag_of_a_power", drag_of_a_power=0.4, drag_of_a_power_power=0.5)
    state = STATE._replace(speed_m_s=np.array([0.25, -1.0]))
    assert force(state) == pytest.approx(np.array([-0.2, 0.4]), rel=1e-3)


@pytest.mark.parametrize("scene", [PAIR, INCLINE], ids=["pair", "incline"])
@pytest.mark.parametrize("form", FORMS, ids=FORM_NAMES)
def test_absent_is_nothing_at_all_with_a_finite_slope(form, scene):
    count = len(scene.names)
    path, speed = (jnp.asarray(values)[:count] for values in STATE[:2])
    state = State(path, speed, STATE.time_s, STATE.is_on_ramp[:count])
    k = jnp.asarray(K)[:count]
    usual = {name: jnp.asarray(value) for name, value in theta().items()}

    def after(values):
        law, force = form.friction(values, scene), form.force(values, scene)
        return (k if law is None else law(state, k)), (0 * k if force is None else force(state))

    friction, pull = after(usual)
    assert (friction == k).all() and (pull == 0.0).all()
    slopes = jax.tree.leaves(jax.jacfwd(after)(usual))
    assert all(np.isfinite(slope).all() for slope in slopes)


def test_a_fall_has_no_friction_to_change():
    fall = replace(INCLINE, has_surface=False)
    without = {form.name for form in FORMS if not form.parameters(fall)}
    assert without == {name for name in FORM_NAMES if name.startswith("friction")}
    law = dynamics(FORMS, fall, {"m1": jnp.ones(())} | theta(), jnp)
    assert np.isfinite(law.drive(STATE._replace(path_m=np.zeros(1), speed_m_s=np.zeros(1)))).all()
