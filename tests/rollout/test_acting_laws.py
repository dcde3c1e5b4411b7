"""Rollouts leave out what does not act, and end when nobody looks: nothing else changes."""

from dataclasses import replace

import jax
import numpy as np
import pytest

from galileo_jax.model.effects.registry import make_effects
from galileo_jax.rollout.acting_laws import FEW, FORCES, FRICTIONS, ActingLaws
from galileo_jax.rollout.engine_rigid import EngineRigid
from tests.precision import in_64_bit
from tests.ramp_model import HIT, make_model, make_theta

EFFECTS = ("air_drag", "friction_patch", "restitution")
ROUNDING_M = 1e-12  # another program rounds otherwise


@pytest.fixture(autouse=True)
def precision():
    with in_64_bit():
        yield


@pytest.fixture(scope="module")
def model():
    return replace(make_model(HIT, 1.0), effects=make_effects(EFFECTS))


def thetas(model, count, **values):
    theta = make_theta(model, HIT)
    for name, value in values.items():
        theta[model.index(name)] = value
    return np.tile(theta, (count, 1))


def test_each_rollout_has_the_laws_that_act_in_it(model):
    parts = [{}, {"air_drag": 0.3}, {"friction_patch": 0.1}, {"restitution": 0.3}]
    theta = np.concatenate([thetas(model, FEW, **values) for values in parts])
    acting = ActingLaws(model).in_each(theta)
    assert acting[::FEW].tolist() == [0, FORCES, FRICTIONS, 0]
    few = ActingLaws(model).in_each(theta[: 2 * FEW + 1])
    assert few[[0, FEW, -1]].tolist() == [0, FORCES, FORCES | FRICTIONS]


def test_a_law_that_acts_is_in_the_share_and_others_are_not(model):
    share = ActingLaws(model).share(FRICTIONS)
    names = {effect.name for effect in share.effects}
    assert {"friction_patch", "restitution"} <= names and "air_drag" not in names
    assert share.names == tuple(np.array(model.names)[list(share.columns)])
    assert "friction_patch_start" in share.names and "air_drag" not in share.names


def test_rollouts_are_those_of_the_whole_model(model):
    values = [{}, {"air_drag": 0.3}, {"friction_patch": 0.1}]
    theta = np.concatenate([thetas(model, FEW, **own) for own in values])
    theta = theta[np.random.default_rng(1).permutation(len(theta))]
    engine = EngineRigid(model)
    whole = jax.jit(engine.traceable)(theta)
    for one, other in zip(engine.simulate(theta), whole, strict=True):
        np.testing.assert_allclose(one, other, atol=ROUNDING_M)
    assert np.ptp(engine.simulate(theta)[0][:, 0, 0, -1]) > 1e-3  # the laws do show


def test_a_rollout_lasts_until_nobody_looks(model):
    engine, theta = EngineRigid(model), thetas(model, 2)
    whole, speed = engine.simulate(theta)
    until = np.array([0.2, 0.3])
    short, its_speed = engine.simulate(theta, until)
    seen = int(until.max() / model.record_dt_s) + 2
    np.testing.assert_array_equal(short[..., :seen], whole[..., :seen])
    np.testing.assert_array_equal(its_speed[..., :seen], speed[..., :seen])
    assert (short[..., -1] == short[..., seen + 2]).all()
    assert (whole[:, 0, 0, -1] > short[:, 0, 0, -1]).all()
