"""Engines as functions of JAX: their calls, and the interpolation between records."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from galileo_jax.model.effects.effect import Theta
from galileo_jax.model.parameters import PriorTable, inverse
from galileo_jax.rollout.engine_c import EngineC
from galileo_jax.rollout.engines import make_engine
from galileo_jax.rollout.rollout import Trajectory, at_times
from galileo_jax.runtime.errors import InputError
from tests.ramp_model import HIT, make_model, make_theta
from tests.rollout.rolled import rolled


class CountingEngine:
    """The C engine, and how large its calls were."""

    name = "c"

    def __init__(self, model):
        self.model, self.engine, self.calls = model, EngineC(model), []

    def simulate(self, theta):
        self.calls.append(len(theta))
        return self.engine.simulate(theta)


@pytest.fixture(scope="module")
def model():
    return make_model(HIT, 1.0)


@pytest.fixture
def start(model):
    """`HIT` in z, nuisances at their priors' middle."""
    theta = make_theta(model, HIT)
    theta[model.index("impact_restitution")] = 0.01
    return inverse(model.parameters, jnp.asarray(theta))


def test_velocities_are_the_derivative_of_positions(model, start):
    """Hermite interpolation, in the clock too: a later release is minus the velocity."""
    motion = rolled(EngineC(model), start)
    times = jnp.linspace(0.1, 0.5, 5)
    slope = jax.jacfwd(lambda delay: at_times(motion, times - delay)[0])(0.0)
    _, velocity = at_times(motion, times)
    assert np.asarray(slope) == pytest.approx(-np.asarray(velocity), rel=1e-6, abs=1e-9)


def test_a_batch_is_one_call(model, start):
    engine = CountingEngine(model)
    batch = jnp.stack([start, start + 0.1, start - 0.1])
    motions = jax.jit(jax.vmap(lambda z: rolled(engine, z).position_m))(batch)
    assert engine.calls == [3]
    alone = rolled(engine, batch[1]).position_m
    assert motions[1] == pytest.approx(np.asarray(alone), abs=0)


def test_interpolation_is_exact_for_constant_acceleration():
    times = jnp.arange(11) * 0.1
    position = (0.3 + 0.5 * times - 0.7 * times**2)[None, None]
    velocity = (0.5 - 1.4 * times)[None, None]
    motion = Trajectory(times, position, velocity)
    asked = jnp.array([-1.0, 0.0, 0.123, 0.55, 0.999, 7.0])
    x, v = at_times(motion, asked)
    inside = np.clip(asked, 0, 1)
    assert np.asarray(x)[0, 0] == pytest.approx(0.3 + 0.5 * inside - 0.7 * inside**2, abs=1e-12)
    assert np.asarray(v)[0, 0, 2:5] == pytest.approx(0.5 - 1.4 * inside[2:5], abs=1e-12)
    assert np.asarray(v)[0, 0, [0, 5]] == pytest.approx(0.0)


@pytest.mark.parametrize("name", ["auto", "rigid", "c", "mjx"])
def test_engines_by_name(name, model):
    assert make_engine(name, model).name == ("rigid" if name == "auto" else name)


def test_unknown_engines_are_refused(model):
    with pytest.raises(InputError, match="unknown value 'bullet'; known: auto, rigid, c, mjx"):
        make_engine("bullet", model)


def test_rollouts_of_effects_see_their_parameters(model, start):
    """`theta` reaches effects by name."""
    named: Theta = model.by_name(np.asarray(PriorTable.of(model.parameters).forward(start)))
    assert float(named["k2"]) == pytest.approx(HIT.friction[1])
    with pytest.raises(ValueError, match="unknown parameter 'k3'; known: m1, k1"):
        model.index("k3")
