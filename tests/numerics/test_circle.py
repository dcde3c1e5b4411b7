"""The circle through points, and how well its radius is known."""

import math

import numpy as np
import pytest

from galileo_jax.numerics.least_squares import circle


def test_radius_and_its_error():
    angle, found = np.linspace(0.2, 1.4, 80), []
    for seed in range(200):
        noise = 1e-3 * np.random.default_rng(seed).normal(size=(2, 80))
        x, y = 0.5 * np.array([np.cos(angle), np.sin(angle)]) + noise
        found.append(circle(3.0 + x, y - 2.0))
    radius = np.array([one.radius for one in found])
    assert radius.mean() == pytest.approx(0.5, abs=1e-3)
    assert np.mean([one.radius_sd for one in found]) == pytest.approx(radius.std(), rel=0.2)
    np.testing.assert_allclose(
        np.mean([one.centre for one in found], axis=0), [3.0, -2.0], atol=1e-3
    )


@pytest.mark.parametrize("noise", [1e-3, 3e-3])
def test_noise_makes_a_flat_arc_no_rounder(noise):
    """Whose height is 22 mm: by linear least squares its radius would be 0.49 and 0.44."""
    angle, found = 0.3 * np.cos(np.linspace(0, 12, 120)), []
    for seed in range(100):
        x, y = 0.5 * np.array([np.sin(angle), -np.cos(angle)])
        x, y = (x, y) + noise * np.random.default_rng(seed).normal(size=(2, 120))
        found.append(circle(x, y))
    radius, sd = (np.array([one[n] for one in found]) for n in (1, 2))
    assert np.median(radius) == pytest.approx(0.5, rel=0.03)
    assert np.mean(np.abs(radius - 0.5) < 3 * sd) > 0.95


def test_three_points_tell_no_error():
    found = circle(np.array([0.0, 1.0, 0.0]), np.array([1.0, 0.0, -1.0]))
    assert found.radius == pytest.approx(1.0) and math.isinf(found.radius_sd) and not found.is_told


def test_a_straight_line_is_no_circle():
    x = np.linspace(0, 1, 20)
    found = circle(x, 2 * x)
    assert found.radius > 1e3 or math.isinf(found.radius_sd)
