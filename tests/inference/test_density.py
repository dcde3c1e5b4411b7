"""The density as a program is the density by hand, for clips of other lengths and scenes, too."""

from dataclasses import replace

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from galileo_jax.inference.fits.residuals import Residuals
from galileo_jax.inference.joint_problem import JointProblem
from galileo_jax.inference.log_posterior import LEAST_SIZES, LogPosterior, density_of
from galileo_jax.inference.samplers.program import Program
from galileo_jax.rollout.engines import make_engine
from galileo_jax.search.imperfect import fit_worlds
from tests.inference.test_joint_problem import STEEPER, draw, log_density_by_hand
from tests.oracle_trials import make_trials
from tests.precision import in_64_bit
from tests.ramp_model import HIT


@pytest.fixture(autouse=True)
def precision():
    with in_64_bit():
        yield


def test_clips_of_one_kind_share_the_code():
    """And so all that is compiled for it; their arrays have the same shapes."""
    one, other = (density_of(make_trials([experiment])) for experiment in (HIT, STEEPER))
    assert one.code == other.code
    assert hash(one.code) == hash(other.code)
    shapes = [jax.tree.map(jnp.shape, program.arrays) for program in (one, other)]
    assert shapes[0] == shapes[1]
    z = jnp.asarray(draw(make_trials([HIT])))
    assert float(one(z)) != pytest.approx(float(other(z)), abs=1.0)


def test_an_engine_that_is_called_back_has_the_same_density():
    trials = make_trials([HIT])
    (problem,) = trials.problems
    called = JointProblem((replace(problem, engine=make_engine("c", problem.model)),))
    z = draw(trials)
    density = density_of(called)
    assert not isinstance(density, Program)
    predicted = called.problems[0].simulate(trials.of_clip(trials.theta(z), 0))
    by_hand = log_density_by_hand(trials, z, [predicted])
    assert float(density(jnp.asarray(z))) == pytest.approx(by_hand, rel=1e-9)


@pytest.mark.parametrize("experiments", [[HIT], [HIT, STEEPER]], ids=["one clip", "two"])
def test_sizes_of_imperfections_are_integrated(experiments):
    """The mean over draws of sizes, as points round a fit are weighed with (`LogPosterior`)."""
    world = fit_worlds(make_trials(experiments), 0, may_be_exact=False).best
    trials, fit = world.trials, world.fit
    assert fit.sizes is not None
    few = replace(fit.sizes, draws=fit.sizes.draws[:LEAST_SIZES])
    fit = replace(fit, sizes=few)
    program = density_of(trials, fit)
    assert isinstance(program, Program)
    by_points = LogPosterior(trials, fit, Residuals(trials))
    rng, sd = np.random.default_rng(1), np.sqrt(np.diag(fit.covariance))
    z = fit.z + 1.5 * sd * rng.standard_normal((6, len(fit.z)))
    apart = np.array([float(program(jnp.asarray(one))) for one in z]) - by_points(z)
    apart -= 0.5 * len(trials.names) * np.log(2 * np.pi)  # of the prior
    np.testing.assert_allclose(apart, 0.0, atol=1e-4)
    at_mode = np.array([float(density_of(trials)(jnp.asarray(one))) for one in z])
    assert np.ptp(at_mode - by_points(z)) > 0.01, "and not that of the most probable sizes"


def test_where_no_rollout_succeeds_it_is_minus_infinity():
    trials = make_trials([HIT])
    program = density_of(trials)
    assert np.isneginf(float(program(jnp.full(len(trials.names), jnp.nan))))
