"""The differentiable rollout: its derivative by hand, its calls, its interpolation."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from galileo_jax.model.effects.effect import Theta
from galileo_jax.model.parameters import forward, inverse
from galileo_jax.rollout.engine_c import EngineC
from galileo_jax.rollout.engines import make_engine
from galileo_jax.rollout.rollout import at_times, make_rollout
from galileo_jax.rollout.trajectory import Trajectory
from galileo_jax.runtime.errors import InputError
from tests.ramp_model import HIT, make_model, make_theta

STEP = 0.01  # in z; of the size that a posterior's standard deviation has
EXACT_RTOL = 1e-9  # the same numbers in another order


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


def simulated(model):
    return [i for i, p in enumerate(model.parameters) if p.step is not None]


def test_derivative_is_the_central_difference(model, start):
    engine = EngineC(model)
    rollout = make_rollout(engine)
    steps = jnp.full(len(start), STEP)
    slopes = jax.jacfwd(lambda z: rollout(z, steps).position_m)(start)
    for i in simulated(model):
        offset = STEP * np.eye(len(start))[i]
        theta = np.stack([forward(model.parameters, start + s * offset) for s in (1, -1)])
        high, low = engine.simulate(theta)[0]
        by_hand = (high - low) / (2 * STEP)
        assert slopes[..., i] == pytest.approx(by_hand, rel=EXACT_RTOL, abs=EXACT_RTOL), (
            model.names[i]
        )


def test_steps_of_each_parameter_are_its_own(model, start):
    rollout = make_rollout(EngineC(model))
    steps = jnp.full(len(start), STEP)
    other = steps.at[model.index("k2")].set(0.3)

    def slope(h):
        return jax.jacfwd(lambda z: rollout(z, h).position_m)(start)

    change = np.abs(np.asarray(slope(steps) - slope(other))).max(axis=(0, 1, 2))
    assert np.flatnonzero(change).tolist() == [model.index("k2")]


def test_release_instant_needs_no_rollout(model, start):
    """The clock's derivative is exact: minus the velocity at the frames."""
    rollout = make_rollout(EngineC(model))
    steps = jnp.full(len(start), STEP)
    release = model.index("release_instant")
    assert release not in simulated(model)
    times = jnp.linspace(0.1, 0.5, 5)

    def position(z):
        shifted = times - forward(model.parameters, z)[release]
        return at_times(rollout(z, steps), shifted)[0]

    slope = np.asarray(jax.jacfwd(position)(start)[..., release])
    _, velocity = at_times(rollout(start, steps), times)
    per_z = float(jax.grad(lambda z: forward(model.parameters, z)[release])(start)[release])
    # Hermite interpolation: its velocity is the derivative of its position.
    assert slope == pytest.approx(-np.asarray(velocity) * per_z, rel=1e-6, abs=1e-9)


def test_a_batch_is_one_call(model, start):
    engine = CountingEngine(model)
    rollout = make_rollout(engine)
    steps = jnp.full(len(start), STEP)
    batch = jnp.stack([start, start + 0.1, start - 0.1])
    motions = jax.jit(jax.vmap(lambda z: rollout(z, steps).position_m))(batch)
    assert engine.calls == [3]
    alone = rollout(batch[1], steps).position_m
    assert motions[1] == pytest.approx(np.asarray(alone), abs=0)


def test_a_derivative_is_one_call(model, start):
    engine = CountingEngine(model)
    rollout = make_rollout(engine)
    steps = jnp.full(len(start), STEP)
    jax.jit(jax.jacfwd(lambda z: rollout(z, steps).position_m))(start).block_until_ready()
    assert engine.calls == [1 + 2 * len(simulated(model))]


def test_interpolation_is_exact_for_constant_acceleration():
    times = jnp.arange(11) * 0.1
    position = (0.3 + 0.5 * times - 0.7 * times**2)[None, None]
    velocity = (0.5 - 1.4 * times)[None, None]
    motion = Trajectory(times, position, velocity, position[:, 0])
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
    named: Theta = model.by_name(np.asarray(forward(model.parameters, start)))
    assert float(named["k2"]) == pytest.approx(HIT.friction[1])
    with pytest.raises(ValueError, match="unknown parameter 'k3'; known: m1, k1"):
        model.index("k3")
