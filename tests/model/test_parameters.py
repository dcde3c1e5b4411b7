"""Priors: maps from the standard normal that keep order, bounds and distribution."""

import jax.numpy as jnp
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import stats

from galileo_jax.model.parameters import (
    HalfNormal,
    LogNormal,
    LongTailed,
    Normal,
    Parameter,
    PriorTable,
    Uniform,
    absent,
    inverse,
)


class Grown:
    """The distribution of a median times e to the power of a variate of another distribution."""

    def __init__(self, median, power):
        self.median, self.power = median, power

    def cdf(self, value):
        return self.power.cdf(np.log(value / self.median))

    def ppf(self, share):
        return self.median * np.exp(self.power.ppf(share))


# Each with its distribution as scipy has it.
PRIORS = {
    "normal": (Normal(0.3, 0.05), stats.norm(0.3, 0.05)),
    "log_normal": (LogNormal(0.4, 0.7), stats.lognorm(0.7, scale=0.4)),
    "long_tailed": (LongTailed(0.01, 0.1), Grown(0.01, stats.johnsonsu(0.0, 1.0, scale=0.1))),
    "uniform": (Uniform(0.1, 0.9), stats.uniform(0.1, 0.8)),
    "half_normal": (HalfNormal(0.2), stats.halfnorm(scale=0.2)),
}
# In 64 bit; a tail's z is lost where theta no longer changes with it.
ROUND_TRIP_ATOL = 1e-6
NUM_DRAWS = 4000
# The chance that draws of the right distribution fail is one in a million.
KOLMOGOROV_P = 1e-6

pytestmark = pytest.mark.usefixtures("x64")
each = pytest.mark.parametrize("name", PRIORS)


@each
@settings(max_examples=40)
@given(z=st.floats(-4, 4))
def test_round_trip(name, z):
    prior, _ = PRIORS[name]
    there = prior.forward(jnp.asarray(z))
    assert float(prior.inverse(there)) == pytest.approx(z, abs=ROUND_TRIP_ATOL)


@each
@settings(max_examples=40)
@given(z=st.floats(-4, 4), more=st.floats(1e-3, 2))
def test_keeps_the_order(name, z, more):
    prior, _ = PRIORS[name]
    low, high = prior.forward(jnp.asarray([z, z + more]))
    assert low < high


@each
def test_standard_normal_becomes_the_prior(name):
    prior, distribution = PRIORS[name]
    z = np.random.default_rng(0).standard_normal(NUM_DRAWS)
    theta = np.asarray(prior.forward(jnp.asarray(z)))
    assert stats.kstest(theta, distribution.cdf).pvalue > KOLMOGOROV_P
    shares = np.linspace(0.001, 0.999, 21)
    quantiles = np.asarray(prior.forward(jnp.asarray(stats.norm.ppf(shares))))
    assert quantiles == pytest.approx(distribution.ppf(shares), rel=1e-6)


@pytest.mark.parametrize(
    "prior, ends", [(Uniform(0.1, 0.9), (0.1, 0.9)), (HalfNormal(0.2), (0.0, 3.0))]
)
def test_finite_at_the_ends(prior, ends):
    z = np.asarray(prior.inverse(jnp.asarray(ends)))
    assert np.isfinite(z).all()
    extreme = np.asarray(prior.forward(jnp.asarray([-30.0, 30.0])))
    assert np.isfinite(extreme).all()
    assert extreme[0] >= ends[0]


def test_vectors_keep_order_and_leading_axes():
    parameters = [
        Parameter("m1", "kg", LogNormal(0.4, 0.7), 0.4),
        Parameter("k1", "1", Uniform(0.0, 1.0), 0.0),
        Parameter("offset", "m", Normal(0.0, 0.003), 0.0, "nuisance"),
    ]
    z = jnp.asarray(np.random.default_rng(1).normal(size=(2, 5, 3)))
    theta = PriorTable.of(parameters).forward(z)
    assert theta.shape == z.shape
    assert np.asarray(inverse(parameters, theta)) == pytest.approx(np.asarray(z), abs=1e-9)
    assert np.asarray(theta[..., 2]) == pytest.approx(0.003 * np.asarray(z[..., 2]))
    assert absent(parameters).tolist() == [0.4, 0.0, 0.0]


@settings(max_examples=40)
@given(st.lists(st.lists(st.floats(-9, 9), min_size=5, max_size=5), min_size=1, max_size=3))
def test_the_table_in_numpy_is_the_compiled_one_and_each_priors_own(rows):
    parameters = [Parameter(name, "1", prior, 0.0) for name, (prior, _) in PRIORS.items()]
    table, z = PriorTable.of(parameters), np.array(rows)
    found = table.in_units(z)
    assert isinstance(found, np.ndarray)
    # At the half-normal's far end, Phi = 1 - 1e-12, the last bits of Phi count.
    assert found == pytest.approx(np.asarray(table.forward(jnp.asarray(z))), rel=1e-4, abs=1e-12)
    own = [p.prior.forward(jnp.asarray(z[:, i])) for i, p in enumerate(parameters)]
    assert found == pytest.approx(np.stack(own, axis=1), rel=1e-4)
    near = np.clip(z, -4, 4)
    exact = np.asarray(table.forward(jnp.asarray(near)))
    assert table.in_units(near) == pytest.approx(exact, rel=1e-11)
    assert table.in_units(z[0]) == pytest.approx(found[0], rel=1e-15)


@pytest.mark.parametrize("prior", [LogNormal(0.4, 0.7), LongTailed(0.4, 0.7)])
def test_what_is_out_of_reach_is_infinite_without_a_warning(prior):
    table = PriorTable.of([Parameter("m1", "kg", prior, 0.0)])
    z = np.array([1e4])
    compiled = np.asarray(table.forward(jnp.asarray(z)))
    assert table.in_units(z).tolist() == [np.inf] == compiled.tolist()
