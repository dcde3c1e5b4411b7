"""A posterior's numbers, and its way to a file and back."""

import numpy as np
import pytest

from galileo_jax.inference.convergence import arviz, convergence
from galileo_jax.inference.posterior import Posterior, Status
from galileo_jax.runtime.errors import InputError


@pytest.fixture
def posterior():
    rng = np.random.default_rng(0)
    draws = rng.normal([0.5, 0.1], [0.2, 0.01], (4, 500, 2)).astype(np.float32)
    return Posterior(
        names=("m1", "k1"),
        draws=draws,
        log_density=rng.normal(size=(4, 500)),
        status=Status.CONVERGED,
        stats={"num_evaluations": 2004, "acceptance_rate": 0.25},
        provenance={"sampler": "mixture", "key": [0, 7]},
    )


def test_netcdf_round_trip(posterior, tmp_path):
    path = tmp_path / "posterior.nc"
    posterior.to_netcdf(path)
    back = Posterior.from_netcdf(path)
    assert back.names == posterior.names
    np.testing.assert_array_equal(back.draws, posterior.draws)
    np.testing.assert_array_equal(back.log_density, posterior.log_density)
    assert back.status is Status.CONVERGED
    assert back.stats == posterior.stats
    assert back.provenance == posterior.provenance
    assert list(tmp_path.iterdir()) == [path]


def test_mapped_and_access(posterior):
    mapped = posterior.mapped(lambda z: np.exp(z[..., :1]), ("ratio",))
    np.testing.assert_allclose(mapped["ratio"], np.exp(posterior["m1"]))
    assert mapped.stats == posterior.stats
    with pytest.raises(ValueError, match="unknown parameter 'k9'; known: m1, k1"):
        posterior["k9"]


def test_shapes_are_checked(posterior):
    with pytest.raises(ValueError, match=r"are not \[chain, draw, 1\]"):
        Posterior(("m1",), posterior.draws, posterior.log_density, Status.CONVERGED)
    with pytest.raises(ValueError, match="does not match"):
        Posterior(("m1", "k1"), posterior.draws, np.zeros((4, 3)), Status.CONVERGED)


def test_what_is_not_ours_is_refused(tmp_path):
    with pytest.raises(InputError, match=r"none\.nc: no such file"):
        Posterior.from_netcdf(tmp_path / "none.nc")
    broken = tmp_path / "broken.nc"
    broken.write_text("not netCDF")
    with pytest.raises(InputError, match=r"broken\.nc: not a netCDF file of draws"):
        Posterior.from_netcdf(broken)
    foreign = tmp_path / "foreign.nc"
    arviz().from_dict(posterior={"x": np.zeros((1, 5))}).to_netcdf(str(foreign), engine="h5netcdf")
    with pytest.raises(InputError, match=r"foreign\.nc: no groups posterior and sample_stats"):
        Posterior.from_netcdf(foreign)


def test_chains_that_disagree_or_never_move_do_not_converge():
    rng = np.random.default_rng(1)
    apart = rng.normal(size=(2, 400)) + np.array([[0.0], [3.0]])
    assert convergence(apart).rhat > 1.5
    assert np.isnan(convergence(np.zeros((2, 400))).rhat)
