"""What modes take up is no noise: how a falling body drifts aside says nothing of the model."""

import numpy as np
import pytest

import galileo_jax as gx
from galileo_jax.similarity.gaussian_likelihood import Whitening


@pytest.mark.parametrize("seed", [4, 20, 24, 29])
def test_a_fall_without_a_hidden_effect_is_described(seed, tmp_path):
    """Of these the drift aside was once taken for a failure (p < 0.002)."""
    track = tmp_path / "fall.csv"
    gx.simulate(track, seed=seed, track_only=True, scenario="fall")
    check = gx.compare(track)
    assert check.p_value > 0.01
    assert set(check.cells["axis"]) == {"y"}


def test_the_share_that_modes_take_up():
    basis = np.array([[1.0, 0.0, 0.0, 0.0], [0.0, 0.6, 0.8, 0.0]]).reshape(2, 1, 2, 2)
    zero = np.zeros((1, 2, 2))
    data = Whitening(zero, np.zeros((1, 2, 2, 2)), basis, np.array([3.0, 1.0]), np.float64(4))
    found = data.absorbed(1.0)
    np.testing.assert_allclose(found, [0.9, 0.5 * 0.36, 0.5 * 0.64, 0.0])
