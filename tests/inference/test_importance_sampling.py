"""Weighed draws, of posteriors whose moments and evidence a sum over a grid gives."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from scipy.optimize import minimize
from scipy.special import logsumexp, softmax

from galileo_jax.inference.fit_posterior import ENOUGH_LOOKED
from galileo_jax.inference.fits import importance_sampling, profile_proposal
from galileo_jax.inference.fits.laplace import Code, GradientFit
from galileo_jax.inference.fits.profile_proposal import ridge_along
from galileo_jax.inference.fits.residuals import Batch, Slopes, cost
from galileo_jax.inference.fits.t_proposal import Cloud
from galileo_jax.inference.fits.transport_map import Valley, valley_round

STEP = 1e-5
AGREES_NATS = 0.1  # four errors of 4096 draws


def points(z):
    return Batch(np.atleast_2d(z), np.empty(0), np.empty(0))


class Known:
    """Residuals `white(z)` of two parameters, without clips and noise scales."""

    clips = ()
    num_rollouts = 0

    def __init__(self, white):
        self.white = white

    def whites(self, points):
        return [np.stack(self.white(*points.z.T), axis=1)]

    def costs(self, points):
        return cost(self.whites(points), points.z)

    def slopes(self, points, steps, sides):
        moved = (points.z[:, None] + s * np.eye(2) for s in (STEP, -STEP))
        ahead, behind = (np.stack(self.white(*np.moveaxis(z, 2, 0)), axis=1) for z in moved)
        index = np.tile(np.arange(2), (len(points.z), 1))
        return Slopes([(ahead - behind) / (2 * STEP)], self.whites(points), index, 2)

    def fit(self, z, free=(True, True)):
        """Laplace's, round `z`; a pinned parameter stays at 0."""
        z, free = np.array(z, float), np.array(free)
        jacobian = self.slopes(points(z), None, True).jacobian[0][0]
        own = np.ix_(free, free)
        covariance = np.zeros((2, 2))
        covariance[own] = np.linalg.inv((jacobian.T @ jacobian + np.eye(2))[own])
        evidence = -float(self.costs(points(z))[0]) + 0.5 * np.linalg.slogdet(covariance[own])[1]
        return GradientFit(
            z=z, free=free, covariance=covariance, chi2=0.0, log_evidence=float(evidence),
            num_values=2, steps=np.full(2, STEP), jacobian=jacobian, code=Code.CONVERGED, stats={},
            pull=0.0, num_pulled=0.0,
        )  # fmt: skip

    def best(self, start):
        """Laplace's, round the mode near `start`."""
        found = minimize(lambda z: self.costs(points(z))[0], start, method="Nelder-Mead")
        return self.fit(found.x)

    def exact(self):
        """By a sum over a grid."""
        axis = np.linspace(-6, 6, 3001)
        grid = np.stack([each.ravel() for each in np.meshgrid(axis, axis)], axis=1)
        costs = self.costs(points(grid))
        return logsumexp(-costs) + 2 * np.log(axis[1] - axis[0]) - np.log(2 * np.pi)


BENT: Any = Known(lambda a, b: ((a - 0.5) / 0.8, (b - a**2) / 0.2))
# Of a positive parameter at the end of its prior: anything below -1 leaves no trace.
AT_THE_EDGE: Any = Known(lambda a, b: (8 * np.maximum(a + 1.0, 0.0) ** 2, (b - 0.3) / 0.2))
# An effect that hardly shows, and nothing of it where its place is beyond what was seen.
LEFT = 1.5
UNSEEN: Any = Known(lambda a, b: (6 * np.exp(a) / (1 + np.exp(8 * b)) - LEFT, 0 * a))
# Each makes up for the other, but not in proportion, by hundreds of the deviations of the rest.
CRESCENT: Any = Known(
    lambda a, b: ((a - 0.1) / 0.4, 300 * (np.exp(b / 3) + np.exp(a / 2 + a**3 / 8) - 2))
)
FLAT: Any = Known(lambda a, b: (0 * a, 0 * b))  # no data: the prior alone
TWO: Any = Known(lambda a, b: ((a**2 - 1) / 0.1, (b - 0.2 * a) / 0.3))


def weighed(fits, known, seed, num=256, most=1536, enough=ENOUGH_LOOKED):
    def density(z):
        return -known.costs(points(z)) - np.log(2 * np.pi)

    return importance_sampling.weighed(fits, known, seed, density, num, most, enough)


def log_mean(found):
    """The evidence: the mean of the weights."""
    return np.asarray(logsumexp(found.log_weights)) - np.log(len(found.z))


@pytest.mark.parametrize(
    ("known", "mode"), [(BENT, (0.3, 0.1)), (AT_THE_EDGE, (-0.8, 0.3))], ids=["bent", "at the edge"]
)
def test_the_mean_of_the_weights_is_the_evidence(known, mode):
    found = weighed([known.best(mode)], known, 0, num=4096)
    assert log_mean(found) == pytest.approx(known.exact(), abs=AGREES_NATS)


def test_valleys_add_up_and_one_counts_once():
    near, far = TWO.best((0.99, 0.2)), TWO.best((-0.99, -0.2))
    both, one = weighed([near, far], TWO, 0, num=4096), weighed([near], TWO, 0, num=4096)
    assert log_mean(both) == pytest.approx(TWO.exact(), abs=AGREES_NATS)
    assert log_mean(both) - log_mean(one) == pytest.approx(np.log(2), abs=AGREES_NATS)
    twice = weighed([near, near], TWO, 0, num=4096)
    assert log_mean(twice) == pytest.approx(log_mean(one), abs=AGREES_NATS)


def test_the_same_seed_gives_the_same_draws():
    fit = BENT.best((0.3, 0.1))
    np.testing.assert_array_equal(weighed([fit], BENT, 3).z, weighed([fit], BENT, 3).z)


@pytest.mark.parametrize("squeezed", [(0.4, 0.02), (0.1, 1.0)])
def test_further_draws_come_from_where_the_posterior_is(squeezed):
    """From a normal that is too narrow in one direction: more draws count, the error falls."""
    fit, exact, root = BENT.best((0.3, 0.1)), BENT.exact(), np.diag(np.sqrt(squeezed))
    narrow = replace(fit, covariance=root @ fit.covariance @ root)
    few, more = (
        [weighed([narrow], BENT, seed, num=64, most=most) for seed in range(10)]
        for most in (64, 2048)
    )
    assert all(one.ess > ENOUGH_LOOKED for one in more)
    error, left = (
        np.sqrt(np.mean([(log_mean(one) - exact) ** 2 for one in found])) for found in (few, more)
    )
    assert left < 0.6 * error


def test_a_cloud_has_the_mean_and_the_covariance_of_what_was_drawn():
    """Draws from N(0, 1), weighed as of N(mean, 0.25); and its density is one of all there is."""
    generator, mean = np.random.default_rng(2), np.array([0.5, -0.3])
    z = np.zeros((20_000, 3))
    z[:, [0, 2]] = generator.standard_normal((20_000, 2))
    log_weights = -2 * np.sum((z[:, [0, 2]] - mean) ** 2, axis=1) + 0.5 * np.sum(z**2, axis=1)
    cloud = Cloud.of(z, log_weights, np.array([True, False, True]))
    np.testing.assert_allclose(cloud.mean, mean, atol=0.03)
    np.testing.assert_allclose(cloud.root @ cloud.root.T, 0.25 * np.eye(2), atol=0.03)
    axis = np.linspace(-12, 12, 601)
    grid = np.zeros((601**2, 3))
    grid[:, [0, 2]] = np.stack([each.ravel() for each in np.meshgrid(axis, axis)], axis=1)
    volume = (axis[1] - axis[0]) ** 2
    assert np.exp(cloud.log_density(grid)).sum() * volume == pytest.approx(1.0, abs=2e-3)


def test_a_cloud_changes_smoothly_as_weights_do():
    """However few draws have all the weight: no table of powers, between which it would jump."""
    z = np.random.default_rng(4).standard_normal((500, 2))
    free, uneven = np.ones(2, bool), -np.sum((z - 0.5) ** 2, axis=1)
    clouds = [Cloud.of(z, power * uneven, free) for power in np.linspace(0.0, 40.0, 4001)]
    widths = np.array([np.trace(cloud.root) for cloud in clouds])
    assert np.abs(np.diff(widths)).max() < 0.02 * np.ptp(widths)


@pytest.mark.parametrize("num_left", [3, 100])
def test_draws_of_no_weight_are_none_of_a_cloud(num_left):
    """Fewer or more of some weight than a cloud needs."""
    z = np.random.default_rng(5).standard_normal((500, 2))
    log_weights = np.where(np.arange(500) < num_left, -np.sum(9 * z**2, axis=1), -np.inf)
    cloud, own = (Cloud.of(z[:k], log_weights[:k], np.ones(2, bool)) for k in (500, num_left))
    np.testing.assert_allclose(cloud.mean, own.mean, rtol=1e-9)
    np.testing.assert_allclose(cloud.root, own.root, rtol=1e-9)


def test_clouds_are_fitted_seldom(monkeypatch):
    """Each multiplies what rounding did to the one before: six for sixteen batches."""
    made, of = [], Cloud.of
    monkeypatch.setattr(Cloud, "of", lambda *known: made.append(len(known[0])) or of(*known))
    weighed([BENT.best((0.3, 0.1))], BENT, 0, num=16, most=16 * 16, enough=np.inf)
    assert made == [16, 32, 48, 80, 128, 192]


def test_a_draw_from_which_no_map_finds_back_has_the_density_it_was_drawn_with(monkeypatch):
    # Tails of a valley that bends much are thrown so far that doubles cannot undo it.
    def nowhere(_, z):
        return np.full(len(z), -np.inf)

    monkeypatch.setattr(Valley, "log_density", nowhere)
    found = weighed([BENT.best((0.3, 0.1))], BENT, 0, num=4096)
    assert log_mean(found) == pytest.approx(BENT.exact(), abs=AGREES_NATS)


def test_a_crescent_is_followed_along_its_ridge(monkeypatch):
    """Draws beside a ridge count for nothing, and those in its middle know nothing of its ends."""
    fit, exact = CRESCENT.best((0.1, -0.2)), CRESCENT.exact()
    found = weighed([fit], CRESCENT, 0, num=512, most=512)
    assert log_mean(found) == pytest.approx(exact, abs=AGREES_NATS)
    assert found.ess > 300
    weights = softmax(found.log_weights)
    mean = float(weights @ found.z[:, 0])
    assert np.sqrt(weights @ (found.z[:, 0] - mean) ** 2) == pytest.approx(0.298, rel=0.08)
    monkeypatch.setattr(profile_proposal, "BENT", np.inf)
    blind = [log_mean(weighed([fit], CRESCENT, seed, num=512, most=512)) for seed in range(12)]
    off = np.median(np.array(blind) - exact)  # of the followed ones it is a thousandth
    assert off < -0.05, "a map of two powers does not follow it to its ends"


def test_the_density_along_a_ridge_is_that_of_its_draws():
    fit = CRESCENT.best((0.1, -0.2))
    valley = valley_round(fit, CRESCENT)
    ridge = ridge_along(fit, valley, CRESCENT)
    assert ridge is not None
    a, b = np.linspace(-1.8, 1.6, 681), np.linspace(-8, 3, 8801)
    grid = np.stack([each.ravel() for each in np.meshgrid(a, b)], axis=1)
    share = np.exp(ridge.log_density(grid)) * (a[1] - a[0]) * (b[1] - b[0])
    assert share.sum() == pytest.approx(1.0, abs=5e-3)
    z, _ = ridge.draw(np.random.default_rng(1), 20_000)
    np.testing.assert_allclose(z.mean(axis=0), share @ grid, atol=0.02)
    np.testing.assert_allclose(
        z.std(axis=0)[0] ** 2, share @ (grid[:, 0] - z[:, 0].mean()) ** 2, rtol=0.05
    )
    beyond = fit.z + 1.1 * ridge.edges[-1] * valley.root[:, ridge.direction]
    assert ridge.log_density(beyond[None]) == -np.inf


def test_directions_that_do_not_show_are_the_same_whatever_rounding_leaves():
    """Covariances a rounding apart, in which any two directions are as good, make one map."""
    fit = FLAT.fit((0.0, 0.0))
    maps = [
        valley_round(replace(fit, covariance=np.eye(2) + off * (1 - np.eye(2))), FLAT)
        for off in (0.0, 1e-15, -1e-15)
    ]
    for other in maps[1:]:
        np.testing.assert_allclose(other.root, maps[0].root, atol=1e-9)
