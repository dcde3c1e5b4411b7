"""The wobble is across the path and as large as the track shows."""

from dataclasses import replace

import numpy as np
import pytest

from galileo_jax.observation.random_patterns import random_patterns
from galileo_jax.similarity import wobble_discrepancy
from galileo_jax.similarity.gaussian_likelihood import GaussianLikelihood
from galileo_jax.similarity.noise_scale import fitted_noise_scale
from galileo_jax.similarity.wobble_discrepancy import WOBBLE_S, WOBBLE_SD_M, wobble_size_m
from tests.oracle_trials import observe
from tests.ramp_model import HIT, make_surroundings

SCENE = make_surroundings(HIT)
NOISE_M = 5e-5
CORNER = SCENE.corner_m[0]
NEAR_FOOT_M = 0.05  # further than the box is long


def across_of(observation):
    """Unit vectors `[object, 2, frame]` across the paths."""
    x = observation.position_m[:, 0]
    slope = np.where((np.arange(len(x)) == 0)[:, None] & (x < CORNER), HIT.angle_rad, 0.0)
    return np.stack([np.sin(slope), np.cos(slope)], axis=1)


def wobbling(size_m, seed, noise_m=NOISE_M, frames=None):
    """A hit whose bodies wobble across their paths; of its first frames, if so said."""
    seen = observe(HIT, seed, noise_m)
    rng = np.random.default_rng([seed, 8])
    apart = np.abs(seen.times_s[:, None] - seen.times_s)
    root = np.linalg.cholesky(np.exp(-apart / WOBBLE_S) + 1e-9 * np.eye(len(apart)))
    size = size_m * rng.standard_normal((len(seen.names), len(apart))) @ root.T
    seen = replace(seen, position_m=seen.position_m + size[:, None] * across_of(seen))
    if frames is not None:
        seen = replace(seen, mask=seen.mask & (np.arange(len(apart)) < frames))
    return seen


def past_foot(observation):
    """The share of each object that is past the foot, `[object, frame]`."""
    x = observation.position_m[:, 0]
    past = np.ones_like(x)
    past[0] = np.clip(0.5 + (x[0] - CORNER) / (2 * NEAR_FOOT_M), 0, 1)
    return past


def size_of(observation):
    across, past = across_of(observation), past_foot(observation)
    return wobble_size_m(observation.position_m, observation, across, past)


def test_it_is_across_the_path_and_of_its_size():
    """Where errors are small: all of it across, none along."""
    hit = observe(HIT, 0, noise_m=1e-6)
    past = past_foot(hit)
    patterns = np.array(wobble_discrepancy.wobble(hit.position_m, hit, SCENE, past))[:, 0]
    wobble = np.einsum("mit,mju->itju", patterns, patterns)
    across = across_of(hit)[0]
    along = np.stack([across[1], -across[0]])
    frames = range(len(hit.times_s))
    for t in frames:
        assert across[:, t] @ wobble[:, t, :, t] @ across[:, t] == pytest.approx(
            WOBBLE_SD_M**2, rel=0.05
        )
        assert abs(along[:, t] @ wobble[:, t, :, t] @ along[:, t]) < 1e-3 * WOBBLE_SD_M**2
    # Neighbours in time wobble together, and the ends of the clip do not.
    first, last = frames[0], frames[-1]
    near = across[:, first] @ wobble[:, first, :, first + 1] @ across[:, first + 1]
    far = across[:, first] @ wobble[:, first, :, last] @ across[:, last]
    assert near > 0.8 * WOBBLE_SD_M**2
    assert abs(far) < 0.05 * WOBBLE_SD_M**2


@pytest.mark.parametrize(("noise_m", "falsifies"), [(2e-6, False), (1e-5, False), (2e-4, True)])
def test_its_size_matters_where_errors_are_as_large(noise_m, falsifies):
    seen = observe(HIT, 0, noise_m)
    apart = np.abs(seen.times_s[:, None] - seen.times_s)
    rough = random_patterns(np.exp(-apart / WOBBLE_S))
    assert wobble_discrepancy.falsifies_noise(rough, across_of(seen), seen) == falsifies


def test_a_body_that_is_lifted_at_a_hit_is_no_misfit():
    seen = wobbling(0.0, 5)
    data = GaussianLikelihood.prepare(seen, SCENE)
    hit = int(np.argmin(np.abs(np.diff(seen.position_m[:, 0], axis=0))))
    lifted = np.zeros_like(seen.position_m)
    lifted[1, 1, hit + 1 :] = 10 * NOISE_M
    left = GaussianLikelihood.tracking_errors(lifted, 1.0, data)
    assert np.sum(left**2) < 2, "of 100 squared errors for each frame after it"


@pytest.mark.parametrize("size_m", [1e-4, 2e-4])
def test_its_size_is_that_of_the_track(size_m):
    found = [size_of(wobbling(size_m, seed)) for seed in range(12)]
    assert np.mean(found) == pytest.approx(size_m, rel=0.2)


def test_bodies_that_do_not_wobble_are_not_said_to():
    """The scatter of some dozens of points can look like a wobble as large as the scatter."""
    assert np.mean([size_of(wobbling(0.0, seed)) for seed in range(12)]) < NOISE_M


def test_a_track_too_short_to_tell_may_wobble_as_most_do():
    assert size_of(wobbling(0.0, 4, frames=5)) == WOBBLE_SD_M


def test_ideal_tracks_have_the_noise_that_they_are_drawn_with():
    """All but a twentieth; with modes as large as any wobble a tenth is missing."""
    found = []
    for seed in range(12):
        seen, clean = observe(HIT, seed, 2e-4), observe(HIT, seed, 0.0)
        data = GaussianLikelihood.prepare(seen, SCENE)
        left = GaussianLikelihood.whiten_batch(seen.position_m - clean.position_m, 1.0, data)
        found += list(fitted_noise_scale(left[None], np.ones(1), np.zeros(1), 1e3, data))
    assert 0.93 < np.mean(found) < 1.02
