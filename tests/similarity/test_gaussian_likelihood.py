"""The likelihood against a dense covariance built by hand."""

from dataclasses import replace

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.stats import multivariate_normal

from galileo_jax.observation.observation import Observation
from galileo_jax.similarity import discrepancy, gaussian_likelihood
from galileo_jax.similarity.discrepancy import crossings, modes
from galileo_jax.similarity.gaussian_likelihood import whitening_in
from tests.ramp_model import HIT, make_surroundings
from tests.reference_ramp import solve

FRAMES = 24
NOISE_M = 3e-4
SAME = 1e-8  # relative; the same sum in another order, of a covariance of condition 1e4
SCENE = make_surroundings(HIT)

pytestmark = pytest.mark.usefixtures("x64")


@pytest.fixture(scope="module")
def observation():
    """The experiment `HIT` with correlated axes, uneven noise and gaps."""
    rng = np.random.default_rng(0)
    times = np.arange(FRAMES) / 20
    centres = solve(HIT, times).position_m
    root = NOISE_M * rng.normal(size=(2, FRAMES, 2, 2)) + NOISE_M * np.eye(2)
    covariance = np.moveaxis(root @ np.swapaxes(root, -1, -2), 1, -1)
    mask = np.ones((2, FRAMES), bool)
    mask[0, 3] = mask[0, 12:14] = mask[1, :2] = False
    position = np.where(mask[:, None], centres + NOISE_M * rng.normal(size=centres.shape), np.nan)
    return Observation(("object1", "object2"), times, position, covariance, mask)


def dense(observation, noise_scale):
    """The covariance of all measured numbers by its definition, and which they are."""
    size = observation.position_m.size
    index = np.arange(size).reshape(observation.position_m.shape)
    tracker = np.zeros((size, size))
    for i in range(2):
        for t in range(FRAMES):
            at = np.ix_(index[i, :, t], index[i, :, t])
            tracker[at] = observation.covariance_m2[i, :, :, t]
    patterns = [modes(observation, SCENE), crossings(observation, SCENE)]
    patterns = np.concatenate(patterns).reshape(-1, size)
    measured = np.broadcast_to(observation.mask[:, None], observation.position_m.shape).reshape(-1)
    pick = np.ix_(measured, measured)
    whole = noise_scale**2 * tracker + patterns.T @ patterns
    return whole[pick], tracker[pick], measured


@pytest.fixture(scope="module")
def difference(observation):
    rng = np.random.default_rng(1)
    return 2e-3 * rng.normal(size=observation.position_m.shape)


@pytest.mark.parametrize("noise_scale", [0.6, 1.0, 2.3])
def test_whitened_residuals(observation, difference, noise_scale):
    data = whitening_in(observation, SCENE)
    white = np.asarray(data.whiten(jnp.asarray(difference), noise_scale))
    in_numpy = data.whiten_batch(difference, noise_scale)
    np.testing.assert_allclose(in_numpy, white.reshape(-1), atol=SAME)
    covariance, _, measured = dense(observation, noise_scale)
    r = difference.reshape(-1)[measured]
    assert np.sum(white**2) == pytest.approx(r @ np.linalg.solve(covariance, r), rel=SAME)
    assert np.abs(white.reshape(-1)[~measured]).max() < SAME
    # Draws of the covariance come out as unit normals.
    draws = np.zeros((400, difference.size))
    root = np.linalg.cholesky(covariance)
    draws[:, measured] = np.random.default_rng(2).normal(size=(400, len(r))) @ root.T
    unit = jax.vmap(lambda d: data.whiten(d, noise_scale))(
        jnp.asarray(draws.reshape(400, *difference.shape))
    )
    spread = np.mean(np.asarray(unit) ** 2) * difference.size / len(r)
    assert spread == pytest.approx(1.0, abs=5 * np.sqrt(2 / (400 * len(r))))


@pytest.mark.parametrize("noise_scale", [0.6, 1.0, 2.3])
def test_log_density(observation, difference, noise_scale):
    data = whitening_in(observation, SCENE)
    predicted = jnp.asarray(data.observed_m - difference)
    value = float(data.log_density(predicted, jnp.asarray(noise_scale)))
    covariance, tracker, measured = dense(observation, noise_scale)
    r = difference.reshape(-1)[measured]
    exact = multivariate_normal(np.zeros(len(r)), covariance).logpdf(r)
    # What is left out does not depend on the prediction or on the noise scale.
    constant = -0.5 * (len(r) * np.log(2 * np.pi) + np.linalg.slogdet(tracker)[1])
    assert value == pytest.approx(exact - constant, rel=SAME)


def test_masked_frames_count_for_nothing(observation):
    data = whitening_in(observation, SCENE)
    elsewhere = replace(
        observation,
        position_m=np.where(observation.mask[:, None], observation.position_m, 7.0),
        covariance_m2=np.where(
            observation.mask[:, None, None], observation.covariance_m2, 9.0 * np.eye(2)[..., None]
        ),
    )
    # Not even through the patterns, which are drawn from measured positions only.
    assert data.num_values == whitening_in(elsewhere, SCENE).num_values
    predicted = jnp.asarray(np.nan_to_num(observation.position_m) + 1e-3)

    def density(x):
        return data.log_density(x, jnp.asarray(1.0))

    gradient = np.asarray(jax.grad(density)(predicted))
    hidden = np.broadcast_to(~observation.mask[:, None], gradient.shape)
    assert (gradient[hidden] == 0).all()
    assert np.isfinite(gradient).all() and (gradient[~hidden] != 0).any()
    moved = jnp.where(jnp.asarray(hidden), predicted + 100.0, predicted)
    assert float(density(moved)) == float(density(predicted))


def test_differences_with_their_exact_covariance(monkeypatch):
    """A flat offset and positions: the same as velocities with tridiagonal covariance."""
    rng = np.random.default_rng(3)
    frames, noise = 15, 2e-4
    times = np.arange(frames) / 30
    truth = np.stack([0.3 * times, 0.1 * times])[None]
    covariance = np.broadcast_to(noise**2 * np.eye(2)[None, ..., None], (1, 2, 2, frames))
    position = truth + noise * rng.normal(size=truth.shape)
    observation = Observation(("object1",), times, position, covariance, np.ones((1, frames), bool))
    flat = np.zeros((2, 1, 2, frames))
    flat[0, 0, 0] = flat[1, 0, 1] = 1e3  # metres: as good as free
    monkeypatch.setattr(gaussian_likelihood, "modes", lambda *_, is_filmed: flat)
    monkeypatch.setattr(gaussian_likelihood, "crossings", lambda *_: np.zeros((0, 1, 2, frames)))
    data = whitening_in(observation, SCENE)

    dt = times[1] - times[0]
    band = 2 * np.eye(frames - 1) - np.eye(frames - 1, k=1) - np.eye(frames - 1, k=-1)
    velocities = multivariate_normal(np.zeros(frames - 1), noise**2 / dt**2 * band)

    def by_velocities(predicted):
        residual = np.diff(position - predicted, axis=-1)[0] / dt
        return sum(velocities.logpdf(axis) for axis in residual)

    def by_positions(predicted):
        one = jnp.asarray(1.0)
        return float(data.log_density(jnp.asarray(predicted), one))

    others = [truth + 0.5, truth * 1.001, truth + 1e-3 * rng.normal(size=truth.shape)]
    for other in others:
        assert by_positions(other) - by_positions(truth) == pytest.approx(
            by_velocities(other) - by_velocities(truth), rel=1e-4, abs=1e-3
        )


def test_modes_are_of_their_size(observation):
    patterns = modes(observation, SCENE)
    assert patterns.shape[1:] == observation.position_m.shape
    assert np.isfinite(patterns).all()
    # Patterns beyond the offsets stay millimetres: they shall not explain away physics.
    assert np.abs(patterns[4:]).max() < discrepancy.OFFSET_SD_M


@pytest.mark.parametrize("largest", [30.0, 1e8])
def test_principal_modes_have_the_patterns_covariance_whatever_their_number(largest, monkeypatch):
    monkeypatch.setattr(gaussian_likelihood, "FEW_VALUES", 0)
    generator = np.random.default_rng(5)
    patterns = generator.standard_normal((40, 12)) * np.geomspace(1e-3, 1.0, 12)
    patterns[0] = largest
    for some in (patterns, patterns[:7]):
        gain, basis = gaussian_likelihood.principal_modes(some)
        exact = some.T @ some
        assert (np.diff(gain) <= 0).all()
        np.testing.assert_allclose(basis @ basis.T, np.eye(len(gain)), atol=1e-9)
        left = (basis.T * gain**2) @ basis - exact
        assert np.abs(left).max() < 1e-14 * np.trace(exact)
