import jax
import jax.numpy as jnp
import numpy as np
import pytest
from flax import nnx

from galileo_jax.neural.config import TrainConfig
from galileo_jax.thesis.task import (
    CM,
    OBJECT2_M,
    Convolution,
    ThesisNetwork,
    ThesisTask,
    average_pool,
)
from tests.ramp_model import HIT

THESIS_PARAMETERS = 13_252


def config(**overrides) -> TrainConfig:
    values = {
        "preset": "thesis",
        "samples": 200,
        "batch": 20,
        "learning_rate": 1e-3,
        "cut": 0.1,
        "patience": 2,
        "cuts": 1,
        "max_epochs": 4,
    }
    return TrainConfig(**(values | overrides))


def test_it_has_the_thesiss_number_of_parameters():
    leaves = jax.tree.leaves(nnx.state(ThesisNetwork(60, nnx.Rngs(0)), nnx.Param))
    assert sum(leaf.size for leaf in leaves) == THESIS_PARAMETERS


@pytest.mark.parametrize("frames", [60, 110])
def test_four_numbers_from_a_profile(frames):
    network = ThesisNetwork(frames, nnx.Rngs(0))
    assert network(jnp.zeros((5, 4, frames))).shape == (5, 4)


def test_the_setting_is_the_thesiss(x64):
    task = ThesisTask(config())
    theta = task.draw(_key(), 4000)
    assert (theta > 0).all()
    assert np.allclose(theta.mean(0), [0.5, 0.15, 0.5, 0.15], atol=0.03)
    assert np.allclose(theta.max(0), [1.0, 0.3, 1.0, 0.3], atol=0.01)
    assert np.isclose(np.rad2deg(task.surroundings.angle_rad), 20)


def test_profiles_are_displacements_of_the_closed_form(x64):
    from dataclasses import replace

    from tests.reference_ramp import solve

    task = ThesisTask(config())
    theta = np.array([[0.5, 0.1, 0.3, 0.2]])
    made = np.diff(task.positions(theta)[0], axis=-1)
    experiment = replace(HIT, mass_kg=(0.5, 0.3), friction=(0.1, 0.2), object2_x_m=OBJECT2_M)
    exact = np.diff(solve(experiment, np.arange(61) / 30).position_m, axis=-1)
    assert np.abs(made - exact).max() < 1e-9
    assert task.make(_key(), 3)["profile"].shape == (3, 4, 60)
    assert CM == 100


@pytest.mark.slow
def test_mujocos_engine_makes_the_same_data(x64):
    theta = np.array([[0.5, 0.1, 0.3, 0.2]])
    rigid, mujoco = (ThesisTask(config(engine=name)).positions(theta) for name in ("rigid", "c"))
    assert np.abs(rigid - mujoco).max() < 3e-3


def _key():
    return jax.random.key(0)


def test_convolution_and_pool_are_the_usual_ones():
    x = jax.random.normal(_key(), (2, 4, 30, 3))
    ours = Convolution(3, 5, nnx.Rngs(0))
    usual = nnx.Conv(3, 5, (1, 7), padding="VALID", rngs=nnx.Rngs(0))
    assert usual.bias is not None and ours.filters.bias is not None
    usual.kernel[...] = ours.filters.kernel[...].reshape(1, 7, 3, 5)
    usual.bias[...] = ours.filters.bias[...]
    assert np.allclose(ours(x), usual(x), atol=1e-5)
    pooled = nnx.avg_pool(x[:, :, :29], (2, 2), (2, 2))
    assert np.allclose(average_pool(x[:, :, :29]), pooled, atol=1e-6)
