"""The thesis's similarities against plain NumPy, and the mask."""

from functools import partial

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.stats import norm

from galileo_jax.api.options import FitOptions, check_choices
from galileo_jax.thesis.similarity import least_work, similarity

FLOAT32_RTOL = 2e-5  # sums of a few dozen numbers


@pytest.fixture
def profiles():
    rng = np.random.default_rng(0)
    predicted = rng.normal(0.5, 1.0, (2, 2, 12)).astype(np.float32)
    observed = predicted + rng.normal(0, 0.3, predicted.shape).astype(np.float32)
    mask = np.ones((2, 12), bool)
    mask[0, :2] = mask[0, 5] = mask[1, 9:] = False
    return predicted, observed, mask


def plain_least_work(x, y):
    table = np.full((len(x) + 1, len(y) + 1), np.inf)
    table[0, 0] = 0
    for i in range(len(x)):
        for j in range(len(y)):
            best = min(table[i, j + 1], table[i + 1, j], table[i, j])
            table[i + 1, j + 1] = abs(x[i] - y[j]) + best
    return table[-1, -1]


def test_unknown_name_lists_the_known():
    with pytest.raises(ValueError, match=r"unknown similarity 'drga'; known: earth_mover, "):
        check_choices(FitOptions(similarity="drga"))  # pyright: ignore[reportArgumentType]


def test_gaussian_is_the_log_density_of_independent_normals(profiles):
    predicted, observed, mask = profiles
    both = np.broadcast_to(mask[:, None], predicted.shape)
    expected = norm.logpdf(observed[both], predicted[both], np.sqrt(0.05)).sum()
    value = similarity("thesis_gaussian", predicted, observed, mask)
    np.testing.assert_allclose(value, expected, rtol=FLOAT32_RTOL)


def test_root_mean_by_hand():
    predicted = jnp.array([[[1.0, 1.0, 0.0, 5.0], [2.0, -1.0, 0.0, 5.0]]])
    observed = jnp.array([[[1.0, 3.0, 0.0, 1.0], [2.0, 1.0, 1.0, 1.0]]])
    mask = jnp.array([[True, True, True, False]])
    expected = np.sqrt((1 + 0.5**2 + 1 + 1 + 0 + 0) / 6)
    value = similarity("root_mean", predicted, observed, mask)
    np.testing.assert_allclose(value, expected, rtol=FLOAT32_RTOL)


@pytest.mark.parametrize("share_masked", [0.0, 0.4, 1.0])
def test_least_work_is_the_plain_dynamic_programme_over_measured_frames(share_masked):
    rng = np.random.default_rng(1)
    compiled = jax.jit(least_work)
    for _ in range(20):
        x, y = rng.normal(size=(2, 9)).astype(np.float32)
        mask = rng.uniform(size=9) >= share_masked
        expected = plain_least_work(x[mask], y[mask])
        np.testing.assert_allclose(compiled(x, y, mask), expected, rtol=1e-4, atol=1e-5)


def test_earth_mover_forgives_a_delay_and_gaussian_does_not():
    pulse = np.zeros((1, 2, 20), np.float32)
    pulse[..., 8:12] = 1.0
    late = np.roll(pulse, 3, axis=-1)
    mask = np.ones((1, 20), bool)
    assert similarity("earth_mover", pulse, late, mask) == 0
    gaussian = partial(similarity, "thesis_gaussian")
    assert gaussian(pulse, late, mask) < gaussian(pulse, pulse, mask)


@pytest.mark.parametrize("name", ["thesis_gaussian", "earth_mover", "root_mean"])
def test_identical_profiles_are_the_best(name, profiles):
    predicted, observed, mask = profiles
    best = similarity(name, observed, observed, mask)
    assert best > similarity(name, predicted, observed, mask)


@pytest.mark.parametrize("name", ["thesis_gaussian", "earth_mover", "root_mean"])
def test_masked_frames_count_for_nothing_in_the_gradient_too(name, profiles):
    predicted, observed, mask = profiles
    both = np.broadcast_to(mask[:, None], predicted.shape)
    value_and_grad = jax.jit(jax.value_and_grad(partial(similarity, name)))
    plain = value_and_grad(predicted, observed, mask)
    hidden = value_and_grad(
        np.where(both, predicted, np.inf), np.where(both, observed, np.nan), mask
    )
    assert plain[0] == hidden[0]
    np.testing.assert_array_equal(plain[1], hidden[1])
    assert np.all(np.isfinite(plain[1]))
    assert np.all(np.asarray(plain[1])[~both] == 0)
    assert np.any(np.asarray(plain[1])[both] != 0)


@pytest.mark.parametrize("name", ["thesis_gaussian", "earth_mover", "root_mean"])
def test_nothing_measured_is_finite(name, profiles):
    predicted, observed, mask = profiles
    value_and_grad = jax.value_and_grad(partial(similarity, name))
    value, gradient = value_and_grad(predicted, observed, np.zeros_like(mask))
    assert np.isfinite(value)
    assert np.all(np.asarray(gradient) == 0)


def test_earth_mover_gradient_is_the_slope(x64):
    rng = np.random.default_rng(3)
    x, y = rng.normal(size=(2, 15))
    mask = rng.uniform(size=15) > 0.2
    compiled = jax.jit(jax.value_and_grad(least_work))
    gradient = np.asarray(compiled(x, y, mask)[1])
    step = 1e-6
    for i in range(15):
        bump = step * np.eye(15)[i]
        slope = (compiled(x + bump, y, mask)[0] - compiled(x - bump, y, mask)[0]) / (2 * step)
        assert gradient[i] == pytest.approx(float(slope), abs=1e-6)
