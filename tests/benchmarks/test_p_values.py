"""Tracks for the calibration of `compare`'s p are what the likelihood says, and are fitted well."""

import functools

import numpy as np
import pytest
from scipy import stats

from benchmarks import p_values
from benchmarks.tracks import make_case
from galileo_jax.similarity import gaussian_likelihood
from galileo_jax.similarity.discrepancy import crossings, modes
from tests.precision import in_64_bit

NUM_TRACKS = 16
LEAST = 1e-4  # of one track in 600 by chance; the seeds are fixed
SIDE_VALLEY = [903, 20]  # its fit was once 39 nats behind the best, and p 2.5e-5
ADEQUATE_P = 0.01


@pytest.fixture(scope="module", autouse=True)
def precision():
    with in_64_bit():
        yield


def drawn(seed):
    """A track with imperfections, and what it would be without."""
    rng = np.random.default_rng([901, seed])
    case = make_case(int(rng.integers(1 << 30)), "exact", p_values.NOISE_M)
    problem = case.problem
    values = [case.values.get(p.name, p.absent) for p in problem.model.parameters]
    clean = problem.simulate(np.array(values))
    noisy = clean + p_values.NOISE_M * rng.standard_normal(clean.shape)
    position = p_values.imperfect(noisy, problem, True, rng)
    return p_values.measured(problem, position, "camera"), clean, position - noisy


def test_drawn_tracks_are_what_their_own_likelihood_says(monkeypatch):
    """At the truth whitened residuals are unit normal, whatever the patterns moved.

    That is, if it allows for as much across the path as was drawn, and not for more.
    Where patterns were those of another track, a quarter of these were below 0.01, down to 1e-100.
    """
    as_drawn = functools.partial(modes, rough_sd_m=0.0)
    monkeypatch.setattr(gaussian_likelihood, "modes", as_drawn)
    chances = []
    for seed in range(NUM_TRACKS):
        problem, clean, _ = drawn(seed)
        white = problem.whiten(clean, 1.0)
        chances.append(stats.chi2.sf(np.sum(white**2), white.size))
    assert min(chances) > LEAST, np.sort(chances)[:4]
    assert stats.kstest(chances, "uniform").pvalue > ADEQUATE_P


def test_imperfections_are_as_large_as_the_likelihood_says():
    problem, _, away = drawn(0)
    scene, seen = problem.model.scene.surroundings, problem.observation
    allowed = modes(seen, scene, rough_sd_m=0.0)
    patterns = np.concatenate([allowed, crossings(seen, scene)])
    flat = patterns.reshape(len(patterns), -1)
    amplitude, *_ = np.linalg.lstsq(flat.T, away.ravel(), rcond=None)
    np.testing.assert_allclose(amplitude @ flat, away.ravel(), atol=1e-6)
    # Drawn normals would fit as well: the least squares can be no longer than these.
    assert 0.3 * len(patterns) < np.sum(amplitude**2) < 2 * len(patterns)


def test_a_right_model_is_not_rejected_for_a_side_valley_of_one_nuisance():
    """No gap, but a rebound: neither both nuisances moved up nor both down lead there."""
    p, *_ = p_values.one("camera", True, 1, SIDE_VALLEY)
    assert p > ADEQUATE_P
