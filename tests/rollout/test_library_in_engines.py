"""Every effect of the library in the C engine and in the rigid one: the same motion."""

from dataclasses import replace

import jax.numpy as jnp
import numpy as np
import pytest

from galileo_jax.model.effects.registry import effect_names, make_effects
from galileo_jax.rollout.engine_c import EngineC
from galileo_jax.rollout.engine_path import EnginePath
from tests.ramp_model import HIT, make_model, make_theta

STRONG_Z = 0.7  # where in its prior each parameter is
POSITION_ATOL_M = 0.004
# Bumpers give a coefficient of restitution within 0.03 (mujoco_fields).
BOUNCE_ATOL_M = 0.015
# MuJoCo's contact carries the weight after 30 ms; what sets off slowly is by then too fast for
# this law. tests/effects has it against closed forms.
NOT_IN_MUJOCO = ("static_friction",)


@pytest.mark.slow
@pytest.mark.parametrize("name", [n for n in effect_names() if n not in NOT_IN_MUJOCO])
def test_c_and_rigid_agree(name):
    model = replace(make_model(HIT, 1.5), effects=make_effects([name]))
    (effect,) = model.effects
    strong = {
        parameter.name: float(parameter.prior.forward(jnp.asarray(STRONG_Z)))
        for parameter in effect.parameters(model.scene.surroundings)
    }
    theta = np.stack([make_theta(model, HIT, given) for given in (strong, {})])
    found, _ = EngineC(model).simulate(theta)
    wanted, _ = EnginePath(model).simulate(theta)
    atol = BOUNCE_ATOL_M if name == "restitution" else POSITION_ATOL_M
    assert found == pytest.approx(wanted, abs=atol)
    moves = any(p.step is not None for p in effect.parameters(model.scene.surroundings))
    assert not moves or np.abs(wanted[0] - wanted[1]).max() > 2 * atol
