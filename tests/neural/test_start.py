"""Chains that start from the network: a fit without a search, and starts that fit together."""

from types import SimpleNamespace

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from galileo_jax.inference.fits.gradient import Code
from galileo_jax.inference.log_posterior import density_of
from galileo_jax.neural.start import completed, start_from_network
from tests.oracle_trials import make_trials
from tests.precision import in_64_bit
from tests.ramp_model import HIT

NUM_CHAINS = 8
SIGMAS = 5.0


@pytest.fixture(autouse=True)
def precision():
    with in_64_bit():
        yield


@pytest.mark.slow
def test_the_network_takes_the_place_of_a_search():
    trials = make_trials([HIT])
    start = start_from_network(trials, seed=0, num_chains=NUM_CHAINS)
    assert start.fit.code is Code.CONVERGED and start.notes == {"init": "cnn"}
    sd = np.sqrt(np.diag(start.fit.covariance))
    k1 = trials.names.index("k1")
    true = trials.parameters[k1].prior.inverse(jnp.asarray(HIT.friction[0]))
    assert abs(start.fit.z[k1] - true) < SIGMAS * sd[k1]
    assert start.z.shape == (NUM_CHAINS, len(trials.names))
    assert len(np.unique(start.z[:, k1])) == NUM_CHAINS
    # Nuisances that do not belong to their k1 would be thousands of standard deviations off.
    best, *others = jax.vmap(density_of(trials))(jnp.asarray([start.fit.z, *start.z]))
    assert best - min(others) < 100
    again = start_from_network(trials, seed=0, num_chains=NUM_CHAINS)
    assert np.array_equal(start.z, again.z)


def test_what_is_not_told_follows_from_what_is():
    root = np.array([[1.0, 0.0, 0.0], [0.8, 0.6, 0.0], [0.3, -0.2, 0.5]])
    mode = np.array([0.5, -1.0, 2.0])
    fit = SimpleNamespace(z=mode, covariance=root @ root.T)
    told = np.array([True, False, False])
    z = np.tile([2.5, np.nan, np.nan], (20_000, 1))
    z[:, ~told] = 0.0
    drawn = completed(z, told, fit, np.random.default_rng(0))  # pyright: ignore
    assert np.array_equal(drawn[:, 0], z[:, 0])
    # Two standard deviations up in the first: the first column of the root, twice.
    assert np.allclose(drawn[:, 1:].mean(0), mode[1:] + 2 * root[1:, 0], atol=0.02)
    left = root[1:, 1:] @ root[1:, 1:].T
    assert np.allclose(np.cov(drawn[:, 1:].T), left, atol=0.02)


def test_only_chains_can_start_from_it(capsys):
    from galileo_jax.commands import command, fit

    assert command.run(fit.main, ["clip.yaml", "--init", "cnn"]) == 2
    assert "--init: of --method mh, not of grad" in capsys.readouterr().err
