"""A fit's posterior by rollouts round it, where slopes at the fit know too little."""

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from galileo_jax.inference import fit_posterior as module
from galileo_jax.inference.fit_posterior import (
    NUM_DRAWS,
    fit_posterior,
    laplace_posterior,
    to_go_on_from,
    uncertain_width,
)
from galileo_jax.inference.fits.gradient import GradientFitter
from galileo_jax.inference.fits.laplace import Code
from galileo_jax.inference.posterior import Status
from galileo_jax.search.fit import best_fit
from tests.inference.test_importance_sampling import BENT, TWO, Known, points
from tests.oracle_trials import make_trials
from tests.precision import in_64_bit
from tests.ramp_model import HIT

# The misfit has a corner at the best fit: steep next to it, shallow beyond.
STEEP, NEXT_TO_IT = 40.0, 0.02


def _cornered(a, b):
    far = a - 0.3
    return 3 * far + STEEP * np.clip(far, -NEXT_TO_IT, NEXT_TO_IT), (b - a) / 0.2


CORNER: Any = Known(_cornered)
AT_THE_CORNER = CORNER.fit((0.3, 0.3))


class Trials:
    """Trials of which parameters are their z."""

    names = ("a", "b")

    def __init__(self, engine: str = "rigid"):
        self.problems = (SimpleNamespace(engine=SimpleNamespace(name=engine)),)

    def theta(self, z, free):
        return np.where(free, z, 0.0)


def of_known(monkeypatch, known):
    """Residuals and log posterior of whatever trials are those of `known`."""
    monkeypatch.setattr(module, "Residuals", lambda trials: known)
    density = lambda *_: lambda z: -known.costs(points(z))  # noqa: E731
    monkeypatch.setattr(module, "LogPosterior", density)


@pytest.fixture
def goes_on_from(monkeypatch):
    def of(known, fit):
        of_known(monkeypatch, known)
        trials: Any = Trials()
        return to_go_on_from(trials, [fit], known, 0)

    return of


@pytest.fixture
def posterior(monkeypatch):
    def of(known, fit, seed=0, engine="rigid"):
        of_known(monkeypatch, known)
        trials: Any = Trials(engine)
        return fit_posterior(trials, fit, seed), laplace_posterior(trials, fit, seed)

    return of


def on_a_grid(known) -> tuple[np.ndarray, np.ndarray]:
    """Mean and standard deviation of both parameters."""
    axis = np.linspace(-3, 3, 1201)
    grid = np.stack([each.ravel() for each in np.meshgrid(axis, axis)], axis=1)
    costs = known.costs(points(grid))
    weights = np.exp(costs.min() - costs)
    weights /= weights.sum()
    mean = weights @ grid
    return mean, np.sqrt(weights @ (grid - mean) ** 2)


def test_at_a_corner_of_the_misfit_it_is_as_wide_as_the_posterior(posterior):
    found, normal = posterior(CORNER, AT_THE_CORNER)
    mean, sd = on_a_grid(CORNER)
    assert normal["a"].std() < 0.3 * sd[0]  # Laplace's is far too narrow there
    draws = found.draws[0]
    assert draws.shape == (NUM_DRAWS, 2)
    np.testing.assert_allclose(draws.std(axis=0), sd, rtol=0.1)
    np.testing.assert_allclose(draws.mean(axis=0), mean, atol=0.15 * sd.min())


def test_a_bent_valley_is_followed(posterior):
    """In the mean of ten seeds: one of them is off by up to a seventh."""
    fit = BENT.best((0.3, 0.1))
    draws = [posterior(BENT, fit, seed)[0].draws[0] for seed in range(10)]
    mean, sd = on_a_grid(BENT)
    np.testing.assert_allclose(np.std(draws, axis=1).mean(axis=0), sd, rtol=0.07)
    np.testing.assert_allclose(np.mean(draws, axis=(0, 1)), mean, atol=0.1 * sd.min())


def test_valleys_have_their_shares(posterior):
    near, far = TWO.best((0.99, 0.2)), TWO.best((-0.99, -0.2))
    found, _ = posterior(TWO, replace(near, beside=(far,)))
    assert np.mean(found["a"] > 0) == pytest.approx(0.5, abs=0.06)
    first = found["a"].ravel()[:400]  # whichever are taken
    assert np.mean(first > 0) == pytest.approx(0.5, abs=0.1)


def test_the_same_seed_gives_the_same_draws_and_another_others(posterior):
    one, again, other = (posterior(CORNER, AT_THE_CORNER, seed)[0].draws for seed in (1, 1, 2))
    np.testing.assert_array_equal(one, again)
    assert not np.array_equal(one, other)


@pytest.mark.parametrize("why", ["slow", "not settled", "many", "few count"])
def test_else_it_is_the_normal_one(posterior, monkeypatch, why):
    fit = AT_THE_CORNER
    if why == "not settled":
        fit = replace(fit, code=Code.STEP_LIMIT)
    if why == "many":
        monkeypatch.setattr(module, "MOST_PARAMETERS", 1)
    if why == "few count":
        monkeypatch.setattr(module, "TOO_FEW", 1e9)
    found, normal = posterior(CORNER, fit, engine="c" if why == "slow" else "rigid")
    np.testing.assert_array_equal(found.draws, normal.draws)
    assert found.status is (Status.STEP_LIMIT if why == "not settled" else Status.CONVERGED)


def test_it_says_where_too_few_draws_count(posterior, monkeypatch):
    enough, normal = posterior(CORNER, AT_THE_CORNER)
    assert uncertain_width(enough) is None and uncertain_width(normal) is None
    monkeypatch.setattr(module, "MOST", 64)
    monkeypatch.setattr(module, "NUM_AT_ONCE", 64)
    few, _ = posterior(CORNER, AT_THE_CORNER)
    said = uncertain_width(few)
    assert said is not None and f"are worth {few.provenance['ess']:.0f} draws" in said
    assert "--method mh" in said


def test_of_a_simulated_hit_both_agree():
    with in_64_bit():
        trials = make_trials([HIT])
        fit = best_fit(GradientFitter(trials), 0)
        found, normal = (make(trials, fit, 0).flat() for make in (fit_posterior, laplace_posterior))
    for name in ("k1", "k2"):
        i = trials.names.index(name)
        sd = normal[:, i].std()
        assert found[:, i].std() == pytest.approx(sd, rel=0.15)
        assert found[:, i].mean() == pytest.approx(normal[:, i].mean(), abs=0.2 * sd)


def test_a_fit_that_describes_the_posterior_leads_nowhere(goes_on_from):
    known: Any = Known(lambda a, b: ((a - 1) / 0.1, (b + 0.5) / 0.3))
    assert goes_on_from(known, known.fit((1 / 1.01, -0.5 / 1.09))).shape == (0, 2)
    assert goes_on_from(BENT, BENT.best((0.3, 0.1))).shape == (0, 2)


def test_from_beside_the_best_it_goes_on_to_the_best(goes_on_from):
    """Two valleys, the second one deeper and next to the fit's; and one that was not fitted."""
    known: Any = Known(lambda a, b: ((a**2 - 0.09) / 0.06, (b - 3 * a + 0.9) / 0.6))
    beside, best = known.best((-0.3, -1.0)), known.best((0.3, 0.0))
    assert best.log_evidence > beside.log_evidence + 0.5
    starts = goes_on_from(known, beside)
    costs = known.costs(points(starts))
    assert costs.min() < known.costs(points(beside.z))[0]
    assert starts[np.argmin(costs), 0] > 0
    beside = BENT.fit((1.0, 1.3))
    better = goes_on_from(BENT, beside)[0]
    assert BENT.costs(points(better))[0] < BENT.costs(points(beside.z))[0] - 0.5


def test_so_many_parameters_that_no_draw_weighs_anything_are_left(goes_on_from, monkeypatch):
    monkeypatch.setattr(module, "MOST_PARAMETERS", 1)
    assert goes_on_from(CORNER, AT_THE_CORNER).shape == (0, 2)
