"""Rollouts leave out what does not act, and end when nobody looks: nothing else changes."""

from dataclasses import replace

import jax
import numpy as np
import pytest

from galileo_jax.model.effects.effect import Effect
from galileo_jax.model.effects.registry import make_effects
from galileo_jax.model.parameters import Normal, Parameter
from galileo_jax.rollout.acting_laws import ActingLaws, seen_share
from galileo_jax.rollout.engine_path import EnginePath
from tests.ramp_model import HIT, make_model, make_theta

EFFECTS = ("air_drag", "friction_patch", "restitution")
ROUNDING_M = 1e-12  # another program rounds otherwise


@pytest.fixture(scope="module")
def model():
    return replace(make_model(HIT, 1.0), effects=make_effects(EFFECTS))


def thetas(model, count, **values):
    theta = make_theta(model, HIT)
    for name, value in values.items():
        theta[model.index(name)] = value
    return np.tile(theta, (count, 1))


def test_rollouts_without_laws_have_a_program_of_their_own(model):
    parts = [
        {},
        {"air_drag": 0.3},
        {"friction_patch": 0.1},
        {"restitution": 0.3},
        {"air_drag": 0.1},
    ]
    theta = np.concatenate([thetas(model, 2, **values) for values in parts])
    (steady, first), (whole, others) = ActingLaws(model).shares(theta)
    assert sorted(first) == [0, 1, 6, 7]
    assert sorted(others) == [2, 3, 4, 5, 8, 9]
    assert {"air_drag", "friction_patch"}.isdisjoint(effect.name for effect in steady.effects)
    assert "friction_patch_start" not in steady.names and "restitution" in steady.names
    assert {"air_drag", "friction_patch_start"} <= set(whole.names)
    for name, column in zip(steady.names, steady.of(theta).T, strict=True):
        if name in model.names:
            np.testing.assert_array_equal(column, theta[:, model.index(name)])


def test_models_of_a_scene_share_their_programs(model):
    """Whatever effects they have: what only one of them has does nothing in the other's."""
    bare = replace(model, effects=())
    drag = replace(model, effects=make_effects(("air_drag", "frame_rate")))
    (one, _), (acting, _) = ActingLaws(model).shares(
        np.concatenate([thetas(model, 1), thetas(model, 1, air_drag=0.3)])
    )
    ((other, _),) = ActingLaws(bare).shares(thetas(bare, 1))
    ((dragging, _),) = ActingLaws(drag).shares(thetas(drag, 1, air_drag=0.3))
    pairs = [(one, other), (acting, dragging), (seen_share(bare), seen_share(drag))]
    for mine, its in pairs:
        assert (mine.effects, mine.names) == (its.effects, its.names)
    assert "release_delay" in seen_share(bare).names and "release_delay" not in one.names


def test_an_effect_of_a_users_own_has_parts_of_this_models_effects(model):
    class Kick(Effect):
        name = "kick"
        unknowns = (Parameter("kick", "m/s", Normal(0.0, 1.0), 0.0, "effect"),)

        def start_speed(self, theta, scene):
            return scene.only(theta["kick"], 0)

    own = replace(model, effects=(*make_effects(("air_drag",)), Kick()))
    ((share, _),) = ActingLaws(own).shares(thetas(own, 1))
    assert {e.name for e in share.effects if e not in own.nuisances} == {"air_drag", "kick"}
    assert "kick" not in seen_share(own).names and "release_delay" in seen_share(own).names


def test_rollouts_with_the_same_laws_are_side_by_side(model):
    drag, patch = thetas(model, 1, air_drag=0.3), thetas(model, 1, friction_patch=0.1)
    ((_, rows),) = ActingLaws(model).shares(np.concatenate([drag, patch] * 3))
    assert sorted(rows[:3] % 2) in ([0, 0, 0], [1, 1, 1])


def test_only_laws_that_act_in_the_batch_do(model):
    ((share, _),) = ActingLaws(model).shares(thetas(model, 2, air_drag=0.3))

    def idle(theta) -> set[str]:
        acts = share.acts(theta)
        assert acts is not None
        every = {effect.name for effect, one in zip(share.effects, acts, strict=True) if not one}
        return every & {effect.name for effect in model.effects}

    assert idle(thetas(model, 2)) == {"air_drag", "friction_patch"}
    both = np.concatenate([thetas(model, 1, air_drag=0.3), thetas(model, 1)])
    assert idle(both) == {"friction_patch"}


def test_rollouts_are_those_of_the_whole_model(model):
    values = [{}, {"air_drag": 0.3}, {"friction_patch": 0.1}]
    theta = np.concatenate([thetas(model, 16, **own) for own in values])
    theta = theta[np.random.default_rng(1).permutation(len(theta))]
    engine = EnginePath(model)
    whole = jax.jit(engine.traceable)(theta)
    for one, other in zip(engine.simulate(theta), whole, strict=True):
        np.testing.assert_allclose(one, other, atol=ROUNDING_M)
    assert np.ptp(engine.simulate(theta)[0][:, 0, 0, -1]) > 1e-3  # the laws do show


def test_a_rollout_lasts_until_nobody_looks(model):
    engine, theta = EnginePath(model), thetas(model, 2)
    whole, speed = engine.simulate(theta)
    until = np.array([0.2, 0.3])
    short, its_speed = engine.each(theta, until, lambda _, *motion: motion)
    seen = int(until.max() / model.record_dt_s) + 2
    np.testing.assert_array_equal(short[..., :seen], whole[..., :seen])
    np.testing.assert_array_equal(its_speed[..., :seen], speed[..., :seen])
    assert (short[..., -1] == short[..., seen + 2]).all()
    assert (whole[:, 0, 0, -1] > short[:, 0, 0, -1]).all()
