"""Draws of a normal approximation, however ill its covariance is conditioned."""

import numpy as np
import pytest

from galileo_jax.inference.fit_posterior import laplace_posterior, two_solutions
from galileo_jax.inference.fits.laplace import Code, GradientFit
from galileo_jax.model.parameters import Normal, Parameter
from galileo_jax.numerics.normal_matrix import symmetric_root

TURN = np.linalg.qr(np.random.default_rng(0).normal(size=(4, 4)))[0]


@pytest.mark.parametrize("least", [1e-3, 0.0, -1e-17])
def test_the_root_of_what_is_hardly_positive(least):
    covariance = (TURN * [1.0, 0.1, 1e-9, least]) @ TURN.T
    root = symmetric_root(covariance)
    assert np.isfinite(root).all()
    np.testing.assert_allclose(root @ root, covariance, atol=1e-15)


class Plain:
    """Trials whose parameters are their z."""

    names = ("restitution", "grip", "place")
    model_parameters = (
        Parameter("restitution", "1", Normal(0.0, 1.0), 0.0, "main"),
        Parameter("grip", "1", Normal(0.0, 1.0), 0.0, "main"),
        Parameter("place", "1", Normal(0.0, 1.0), 0.0, "nuisance"),
    )

    def theta(self, z, free):
        return np.where(free, z, 0.0)


def fit_at(z, sd, log_evidence, **more) -> GradientFit:
    return GradientFit(
        z=np.array(z), free=np.ones(3, bool), covariance=np.diag(np.square(sd)), chi2=9.0,
        log_evidence=log_evidence, num_values=9, steps=np.ones(3), jacobian=np.zeros((9, 3)),
        code=Code.CONVERGED, stats={}, pull=0.0, num_pulled=0.0, **more,
    )  # fmt: skip


def test_two_valleys_share_the_draws_by_their_evidence():
    other = fit_at([0.8, 0.1, 0.0], [0.06, 0.1, 1.0], -np.log(3.0))
    found = fit_at([0.94, 0.5, 5.0], [0.01, 1.0, 1.0], 0.0, beside=(other,))
    posterior = laplace_posterior(Plain(), found, 0)  # pyright: ignore
    draws = posterior["restitution"].ravel()
    is_other = draws < 0.87
    assert is_other.mean() == pytest.approx(0.25, abs=0.04)
    assert draws[is_other].std() > 4 * draws[~is_other].std()
    assert is_other[:400].mean() == pytest.approx(0.25, abs=0.08)  # whichever are taken
    every = posterior.flat()
    said = two_solutions(Plain(), found, every)  # pyright: ignore
    assert said is not None and "2 solutions" in said
    assert "restitution 0.94 (75%) or 0.8 (25%); the intervals contain them all" in said
    narrow = every[~is_other]
    assert "contain 1 of them" in str(two_solutions(Plain(), found, narrow))  # pyright: ignore


def test_one_valley_has_all_draws():
    found = fit_at([0.94, 0.5, 5.0], [0.01, 1.0, 1.0], 0.0)
    posterior = laplace_posterior(Plain(), found, 0)  # pyright: ignore
    draws = posterior["restitution"].ravel()
    assert draws.mean() == pytest.approx(0.94, abs=0.001)
    assert two_solutions(Plain(), found, posterior.flat()) is None  # pyright: ignore


def test_two_valleys_that_differ_in_what_nobody_asked_for_are_not_told():
    other = fit_at([0.9401, 0.5, 0.0], [0.001, 1.0, 1.0], -2.0)
    found = fit_at([0.94, 0.5, 5.0], [0.001, 1.0, 1.0], 0.0, beside=(other,))
    every = laplace_posterior(Plain(), found, 0).flat()  # pyright: ignore
    assert two_solutions(Plain(), found, every) is None  # pyright: ignore
