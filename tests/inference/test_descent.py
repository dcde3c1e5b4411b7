"""Levenberg-Marquardt over batches of rollouts."""

from typing import Any

import numpy as np
import pytest
from scipy.optimize import least_squares
from scipy.special import ndtr

from galileo_jax.inference.fits.descent import FEW, Descent, GiveUp, ends_of, join, secants
from galileo_jax.inference.fits.gradient import GradientFitter
from galileo_jax.inference.fits.kernels import Quadratic
from galileo_jax.inference.fits.residuals import Batch, Sides, Slopes, cost
from galileo_jax.search.fit import best_fit
from galileo_jax.search.starts import scattered_starts
from tests.oracle_trials import make_trials
from tests.precision import in_64_bit
from tests.ramp_model import HIT


@pytest.fixture(autouse=True)
def precision():
    with in_64_bit():
        yield


class Banana:
    """Rosenbrock's valley in z1 and z2, and a third parameter of no effect; no rollouts."""

    def __init__(self, steepness: float = 10.0):
        self.steepness = steepness

    def motions(self, points: Batch):
        return [(points.z, points.z, points.z)]

    def whites_of(self, points: Batch, motions):
        z = motions[0][0]
        return [np.stack([self.steepness * (z[:, 1] - z[:, 0] ** 2), 3 - z[:, 0]], axis=1)]

    def whites(self, points: Batch):
        return self.whites_of(points, self.motions(points))

    def no_slopes(self, free) -> Slopes:
        count = len(free)
        index = np.tile(np.arange(3), (count, 1))
        return Slopes([np.zeros((count, 2, 3))], [np.zeros((count, 2))], index, 3)

    def slopes(self, points: Batch, steps: np.ndarray, sides: Sides, motions=None) -> Slopes:
        z = points.z
        [white] = self.whites_of(points, motions or self.motions(points))
        jacobian = np.zeros((len(z), 2, 3))
        jacobian[:, 0, 0] = -2 * self.steepness * z[:, 0]
        jacobian[:, 0, 1], jacobian[:, 1, 0] = self.steepness, -1
        index = np.tile(np.arange(3), (len(white), 1))
        return Slopes([np.where(points.free[:, None], jacobian, 0.0)], [white], index, 3)


def batch(*z, free: np.ndarray | bool = True):
    z = np.array(z, float)
    return Batch(z, np.broadcast_to(free, z.shape), np.ones((len(z), 1)))


def descend(points, enough=1e-9, max_steps=200, give_up=None):
    banana: Any = Banana()
    descent = Descent(banana, np.ones(3), is_smooth=True, sides="ahead")
    return descent(points, enough, max_steps, give_up)


def expected_minimum():
    def residuals(z):
        return np.concatenate([[10 * (z[1] - z[0] ** 2), 3 - z[0]], z])

    return least_squares(residuals, [1.0, 1.0], xtol=1e-15, ftol=1e-15, gtol=1e-15)


def test_every_start_of_a_batch_arrives_at_the_end_of_a_curved_valley():
    points = batch([-1.2, 1.0, 0.5], [2.0, -1.0, 0.0], [0.0, 0.0, 3.0])
    found = descend(points)
    best = expected_minimum()
    assert found.is_settled.all()
    np.testing.assert_allclose(found.best.z[:, :2], np.tile(best.x, (3, 1)), atol=1e-4)
    np.testing.assert_allclose(found.best.z[:, 2], 0.0, atol=1e-4)
    np.testing.assert_allclose(found.best.cost, best.cost, atol=1e-8)
    white = Banana().slopes(points, np.ones(3), "ahead").white
    np.testing.assert_allclose(found.first_cost, cost(white, points.z))


@pytest.mark.parametrize("steepness", [1e2, 1e4])
def test_steps_follow_a_valley_that_bends(steepness):
    """They are few times fewer than those straight ahead, which leave it and are refused."""
    steps = []
    for is_smooth in (True, False):
        descent = Descent(Banana(steepness), np.ones(3), is_smooth, "ahead")  # pyright: ignore
        found = descent(batch([-1.2, 1.0, 0.5]), 1e-9, 2000)
        np.testing.assert_allclose(found.best.z[0, 1], found.best.z[0, 0] ** 2, atol=1e-2)
        steps.append(found.num_steps)
    assert found.is_settled.all() and steps[0] < 0.6 * steps[1]


class Misfit(Banana):
    """Residuals that stay large, 20 (z + 1, 0.9 z^2 + z - 1): by J^T J steps shrink to 0.9 each.

    Source: K. Madsen, H. B. Nielsen, O. Tingleff, Methods for non-linear least squares problems
    (2004), example 3.4.
    """

    def whites_of(self, points: Batch, motions):
        z = motions[0][0][:, 0]
        return [20 * np.stack([z + 1, 0.9 * z**2 + z - 1], axis=1)]

    def slopes(self, points: Batch, steps: np.ndarray, sides: Sides, motions=None) -> Slopes:
        z = points.z
        jacobian = np.zeros((len(z), 2, 3))
        jacobian[:, 0, 0], jacobian[:, 1, 0] = 20, 20 * (1.8 * z[:, 0] + 1)
        index = np.tile(np.arange(3), (len(z), 1))
        return Slopes([jacobian], self.whites_of(points, [(z, z, z)]), index, 3)


class Steep(Banana):
    """One residual of two parameters, so steep that nothing is left of the prior beside it."""

    def whites_of(self, points: Batch, motions):
        return [np.repeat(1e9 * (motions[0][0][:, :1] + motions[0][0][:, 1:2] - 1), 2, axis=1)]

    def slopes(self, points: Batch, steps: np.ndarray, sides: Sides, motions=None) -> Slopes:
        z, jacobian = points.z, np.zeros((len(points.z), 2, 3))
        jacobian[:, :, :2] = 1e9
        index = np.tile(np.arange(3), (len(z), 1))
        return Slopes([jacobian], self.whites_of(points, [(z, z, z)]), index, 3)


def test_slopes_that_leave_nothing_of_the_prior_are_no_crash():
    found = Descent(Steep(), np.ones(3), True, "ahead")(batch([0.3, 0.2, 0.1]), 1e-3, 30)  # pyright: ignore
    assert np.isfinite(found.best.z).all()


def test_where_much_is_left_steps_know_the_curvature():
    steps = []
    for is_smooth in (True, False):
        descent = Descent(Misfit(), np.ones(3), is_smooth, "ahead")  # pyright: ignore
        found = descent(batch([0.8, 0.5, 0.5], [0.4, 1.0, 0.0]), 1e-9, 500)
        assert found.is_settled.all()
        np.testing.assert_allclose(found.best.z, 0.0, atol=1e-3)
        steps.append(found.num_steps)
    assert steps[0] < 0.4 * steps[1]


def test_secants_are_the_least_change_that_tells_the_last_step():
    rng = np.random.default_rng(0)
    second = rng.standard_normal((5, 3, 3))
    second += np.swapaxes(second, 1, 2)
    step, turned, change = rng.standard_normal((3, 5, 3))
    change *= np.sign(np.sum(change * step, axis=1))[:, None]
    change[4] *= -1  # the cost bends downwards there
    found = secants(second, step, turned, change)
    np.testing.assert_allclose(found, np.swapaxes(found, 1, 2), atol=1e-12)
    told = np.einsum("pij,pj->pi", found, step)
    np.testing.assert_allclose(told[:4], turned[:4], atol=1e-10)
    np.testing.assert_array_equal(found[4], second[4])


def test_costs_never_rise_with_more_steps():
    costs = [descend(batch([-1.2, 1.0, 0.0]), max_steps=n).best.cost[0] for n in range(1, 20)]
    assert all(np.diff(costs) <= 0) and costs[-1] < costs[0]


def test_slopes_are_taken_only_where_a_step_has_got_somewhere(monkeypatch):
    costs, residuals = [], Banana()
    slopes = residuals.slopes

    def watched(points, *rest):
        costs.append(cost(residuals.whites_of(points, residuals.motions(points)), points.z)[0])
        return slopes(points, *rest)

    monkeypatch.setattr(residuals, "slopes", watched)
    descent = Descent(residuals, np.ones(3), is_smooth=True, sides="ahead")  # pyright: ignore
    count = FEW + 1  # of fewer all are
    found = descent(batch(*[[-1.2, 1.0, 0.0]] * count), 1e-9, 200)
    assert all(np.diff(costs) < 0) and len(costs) < found.num_steps


def test_steps_that_run_out_are_told():
    found = descend(batch([-1.2, 1.0, 0.0]), max_steps=2)
    assert found.num_steps == 2 and not found.is_settled.any()


def test_pinned_parameters_stay():
    free = np.array([True, False, True])
    found = descend(batch([-1.2, 0.0, 1.0], free=free))
    assert found.best.z[0, 1] == 0.0
    assert found.is_settled.all()


def test_only_who_is_behind_a_rival_and_does_not_catch_up_is_given_up():
    give_up = GiveUp(np.array([0, 0, 0, 1]), behind=20.0, price=np.array([0.0, 0.0, 0.0, 1e3]))
    cost_nats, promised = np.array([1.0, 30.0, 30.0, 500.0]), np.array([0.1, 1.0, 9.0, 0.1])
    assert give_up(cost_nats, promised).tolist() == [False, True, False, False]
    alone = GiveUp(np.zeros(2, int), behind=20.0, price=np.array([0.0, 25.0]))
    assert alone(np.array([1.0, 1.0]), np.zeros(2)).tolist() == [False, True]


def test_who_is_far_behind_another_hypothesis_is_given_up_unless_it_may_catch_up():
    owner, cost_nats = np.array([0, 1, 1, 2]), np.array([1.0, 70.0, 75.0, 40.0])
    promised = np.array([0.1, 1.0, 30.0, 0.1])
    assert not GiveUp(owner, behind=20.0)(cost_nats, promised).any()
    give_up = GiveUp(owner, behind=20.0, behind_all=60.0)
    assert give_up(cost_nats, promised).tolist() == [False, True, False, False]
    elsewhere = give_up._replace(lowest=-30.0)
    assert elsewhere(cost_nats, promised).tolist() == [False, True, False, True]


def test_starts_that_meet_go_on_as_one():
    """Two of one owner in one valley, one of another owner, one where nothing shows yet."""
    z = np.array([[0.0, 0.0], [0.5, 0.0], [0.1, 0.0], [0.0, 1.2]])
    cost_nats, normal = np.array([1.0, 1.3, 1.0, 1.2]), np.tile(np.eye(2), (4, 1, 1))
    normal[3] *= 4.0
    best = Quadratic(z, cost_nats, np.zeros((4, 2)), normal)
    joined = np.arange(4)
    join(best, np.array([0, 0, 1, 0]), joined)
    assert joined.tolist() == [0, 0, 2, 3]
    assert ends_of(np.array([0, 0, 1, 2])).tolist() == [0, 0, 0, 0]


def test_those_that_joined_cost_no_more_steps():
    starts = batch([-1.2, 1.0, 0.5], [-1.2001, 1.0, 0.5], [-1.2, 1.0, 0.5])
    found = descend(starts, give_up=GiveUp(np.array([0, 0, 1]), behind=20.0))
    assert found.joined[1] == 0 or found.joined[0] == 1
    best = expected_minimum().cost
    np.testing.assert_allclose(found.best.cost[ends_of(found.joined)], best, atol=1e-8)
    assert not found.is_settled[:2].all() and found.is_settled[2]


def test_scattered_starts_fill_every_range_once():
    trials = make_trials([HIT])
    names = [p.name for p in trials.model_parameters]
    starts = scattered_starts(trials, np.ones(len(names), bool), 32, seed=3)
    strata = np.sort(np.floor(32 * ndtr(starts[:, names.index("m1")])))
    np.testing.assert_array_equal(strata, np.arange(32))
    assert starts.std(axis=0)[[p.role == "nuisance" for p in trials.model_parameters]].max() == 0
    again = scattered_starts(trials, np.ones(len(names), bool), 32, seed=3)
    np.testing.assert_array_equal(starts, again)


@pytest.mark.parametrize("edge", [-3.9, -3.0])
def test_a_fit_comes_back_from_the_edge(edge):
    """Where a coefficient of friction no longer moves with z."""
    trials = make_trials([HIT])
    fitter = GradientFitter(trials)
    best = best_fit(fitter, 0)
    count = len(trials.model_parameters)
    start = best.z[:count].copy()
    start[[p.name for p in trials.model_parameters].index("k1")] = edge
    (found,) = fitter.fit_from(start[None], best.free[None, :count], np.zeros(1, int))
    assert found.log_evidence == pytest.approx(best.log_evidence, abs=0.5)
