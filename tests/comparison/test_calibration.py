"""Under the model p-values are uniform as far as they claim to be, and intervals hold the truth."""

from dataclasses import replace

import jax.numpy as jnp
import numpy as np
import pytest
from scipy import stats

from galileo_jax.comparison import compare as module
from galileo_jax.comparison.compare import compare
from galileo_jax.inference.fits.gradient import GradientFitter
from galileo_jax.inference.joint_problem import JointProblem
from galileo_jax.model.parameters import inverse
from galileo_jax.similarity.discrepancy import crossings, modes
from tests.oracle_trials import make_trials
from tests.ramp_model import HIT

NUM_TRACKS, NUM_REPLICATES = 40, 200
CHANCE = 0.01  # of a right comparison failing a test, had other seeds been taken
MOST_BELOW = stats.binom.isf(CHANCE, NUM_TRACKS, 0.05)  # the seeds are fixed: this is no lottery


def fit_near_truth(trials):
    """Starts at the truth and refines: that it is found from afar is tested elsewhere."""
    values = {"m1": HIT.mass_kg[0], "m2": HIT.mass_kg[1]}
    values |= {"k1": HIT.friction[0], "k2": HIT.friction[1]}
    parameters = trials.model_parameters
    theta = np.array([values.get(p.name, p.absent) for p in parameters])
    start = np.clip(np.asarray(inverse(parameters, jnp.asarray(theta))), -1.0, 1.0)[None]
    return GradientFitter(trials).polish(start, np.ones(start.shape, bool), np.zeros(1, int))[0]


def disturbed(trials, away_m):
    """The only clip, with its positions moved by `[object, 2, frame]`."""
    (problem,) = trials.problems
    seen = problem.observation
    return JointProblem(
        (replace(problem, observation=replace(seen, position_m=seen.position_m + away_m)),)
    )


def draw_imperfections(trials, seed):
    """What the likelihood allows for beside the tracker's noise: modes, and the foot."""
    (problem,) = trials.problems
    seen, scene = problem.observation, problem.model.scene.surroundings
    patterns = np.concatenate([modes(seen, scene, rough_sd_m=0.0), crossings(seen, scene)])
    normal = np.random.default_rng([seed, 8]).standard_normal(len(patterns))
    return np.tensordot(normal, patterns, axes=1)


@pytest.fixture(scope="module")
def imperfect():
    """Trials, fits and p-values of `NUM_TRACKS` tracks as the likelihood says they are."""
    made = []
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(module, "NUM_REPLICATES", NUM_REPLICATES)
        for seed in range(NUM_TRACKS):
            trials = make_trials([HIT], seed)
            trials = disturbed(trials, draw_imperfections(trials, seed))
            fit = fit_near_truth(trials)
            made.append((trials, fit, compare(trials, fit, seed).p_value))
    return made


def p_values(imperfect):
    return np.array([p for _, _, p in imperfect])


def test_p_values_under_the_model_are_not_too_small(imperfect):
    p = p_values(imperfect)
    assert ((p >= 0) & (p <= 1)).all()
    assert np.sum(p < 0.05) <= MOST_BELOW, np.sort(p)[:8]
    assert np.sum(p < module.ADEQUATE_P) <= 1, np.sort(p)[:8]


@pytest.mark.parametrize("level", [0.25, 0.5, 0.75, 1.0 - 1e-9])
def test_p_values_under_the_model_are_uniform(level, imperfect):
    """Twice the smaller of two p-values, the residuals' and the nuisances'.

    The residuals' is uniform, so that at least level / 2 of all are below a level, and half of
    them below 1; the nuisances' makes it level at the most. Within what chance does to 40.
    """
    below = int(np.sum(p_values(imperfect) <= level))
    least = stats.binom.ppf(CHANCE, NUM_TRACKS, level / 2)
    most = stats.binom.isf(CHANCE, NUM_TRACKS, level)
    assert least <= below <= most, np.sort(p_values(imperfect))


def test_intervals_are_as_wide_as_the_errors_are_large(imperfect):
    """Errors over the posterior's sd, their mean square against a chi square's."""
    k1, k2 = HIT.friction
    truth = np.array([k1, k2, np.log(HIT.mass_kg[0] / HIT.mass_kg[1])])
    z = []
    for trials, fit, _ in imperfect:
        normal = np.random.default_rng(6)
        draws = normal.multivariate_normal(fit.z, fit.covariance, 1000, method="svd")
        theta = trials.theta(draws, fit.free)
        m1, m2, k1, k2 = (theta[:, trials.names.index(name)] for name in ("m1", "m2", "k1", "k2"))
        told = np.stack([k1, k2, np.log(m1 / m2)])
        z.append((told.mean(axis=1) - truth) / told.std(axis=1))
    total = np.sum(np.square(z), axis=0)
    assert (total > stats.chi2.ppf(CHANCE, NUM_TRACKS)).all(), "too wide"
    assert (total < stats.chi2.isf(CHANCE, NUM_TRACKS)).all(), "too narrow"


def test_a_perfect_track_is_adequate():
    """Only the tracker's noise, none of the imperfections that are allowed for."""
    trials = make_trials([HIT])
    found = compare(trials, fit_near_truth(trials), 0)
    assert found.is_adequate
    z = [place.z for place in found.where]
    assert z == sorted(z, reverse=True)
    assert found.white[0].shape == (2, 2, found.labels[0].shape[1])
    assert 0.7 < found.error["chi2_per_dof"] < 1.5


def test_noise_of_another_size_is_said_to_be_that():
    """White errors 2.1 times what is stated contradict the statement, not the model."""
    (problem,) = make_trials([HIT], 5).problems
    seen = problem.observation
    stated = replace(seen, covariance_m2=seen.covariance_m2 / 2.1**2)
    trials = JointProblem((replace(problem, observation=stated),))
    found = compare(trials, fit_near_truth(trials), 0)
    assert found.is_noise_misstated and found.is_adequate
    assert found.noise_scale[0] == pytest.approx(2.1, rel=0.2)
    assert found.error["chi2_per_dof"] > 3


def test_a_deviation_is_seen_where_it_is():
    """A millimetre to and fro along the ramp, which no parameter makes."""
    trials = make_trials([HIT])
    times = trials.problems[0].observation.times_s
    away = np.zeros((2, 2, len(times)))
    slope = np.array([np.cos(HIT.angle_rad), -np.sin(HIT.angle_rad)])
    bump = np.where((times > 0.2) & (times < 0.6), np.sin((times - 0.2) * 10 * np.pi), 0.0)
    away[0] = 1e-3 * slope[:, None] * bump
    wrong = disturbed(trials, away)
    found = compare(wrong, fit_near_truth(wrong), 0)
    assert not found.is_adequate and not found.is_noise_misstated
    assert found.where[0].object == "object1"
    assert found.where[0].phase in ("ramp", "whole")
