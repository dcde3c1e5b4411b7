"""The thesis's preset: its proposals, its acceptance, its two ways to choose an answer."""

from typing import get_args

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy import stats

from galileo_jax.inference.posterior import Posterior, Status
from galileo_jax.thesis.sampler import (
    Acceptance,
    Thesis,
    ThesisState,
    infer,
    select,
)

TRUTH = jnp.array([0.6, 0.1, 0.4, 0.15])


def similarity(theta):
    return -jnp.sum((theta - TRUTH) ** 2) / 0.05


def steps(log_density, num_steps_before, start, acceptance: Acceptance = "coin", num=4000):
    """One step of many chains from `start`, the given number of steps made before."""
    sampler = Thesis(acceptance=acceptance)
    state = ThesisState(start, log_density(start), jnp.asarray(num_steps_before, jnp.int32))
    keys = jax.random.split(jax.random.key(0), num)
    return jax.jit(jax.vmap(lambda key: sampler.step(key, state, log_density)))(keys)


def test_proposals_are_narrow_and_wide_on_every_twentieth_step():
    start = jnp.array([0.5, 0.02])

    def accept_all(theta):
        return jnp.zeros(())

    for before, width in ((0, 0.05), (18, 0.05), (19, 0.5), (20, 0.05), (39, 0.5)):
        moved, info = steps(accept_all, before, start)
        assert bool(info.is_accepted.all())
        position = np.asarray(moved.position)
        assert np.all((position > 0) & (position < 1))
        low = np.maximum(start - width, 0)
        high = np.minimum(start + width, 1)
        for i in range(2):
            scaled = (position[:, i] - low[i]) / (high[i] - low[i])
            assert stats.kstest(scaled, "uniform").pvalue > 1e-4


def test_better_is_always_kept_and_worse_by_a_coin():
    start = jnp.array([0.5])
    _, info = steps(lambda theta: 100 * theta[0], 0, start)
    rose = np.asarray(info.acceptance_rate) == 1.0
    kept = np.asarray(info.is_accepted)
    assert 0.45 < rose.mean() < 0.55
    assert kept[rose].all()
    assert stats.binomtest(int(kept[~rose].sum()), int((~rose).sum()), 0.5).pvalue > 1e-4
    # A true Metropolis step would almost never go 2.5 down.
    _, metropolis = steps(lambda theta: 100 * theta[0], 0, start, "metropolis")
    assert np.asarray(metropolis.is_accepted).mean() < kept.mean() - 0.1


def test_nan_is_never_kept():
    start = jnp.array([0.5])
    _, info = steps(lambda t: jnp.where(t[0] == 0.5, 0.0, jnp.nan), 0, start)
    assert not bool(info.is_accepted.any())


def test_metropolis_option_samples_the_density_up_to_the_walls():
    """Beta(1, 1) needs the Hastings correction: near a wall the proposals are lopsided."""
    sampler = Thesis(acceptance="metropolis")

    def log_density(theta):
        return jnp.zeros(())

    def one(key):
        state = sampler.init(jnp.array([0.5]), log_density)

        def body(state, key):
            return sampler.step(key, state, log_density)[0], None

        return jax.lax.scan(body, state, jax.random.split(key, 120))[0].position[0]

    draws = jax.jit(jax.vmap(one))(jax.random.split(jax.random.key(1), 4000))
    assert stats.kstest(np.asarray(draws), "uniform").pvalue > 1e-3


@pytest.mark.parametrize("acceptance", get_args(Acceptance))
def test_infer(acceptance):
    posterior = infer(jax.random.key(0), similarity, acceptance=acceptance)
    draws, estimate = posterior.draws, select(posterior, "best")
    assert draws.shape == (16, 75, 4)
    assert posterior.names == ("m1", "k1", "m2", "k2")
    assert posterior.stats["num_evaluations"] == 1216
    assert posterior.status is Status.FIXED_LENGTH
    assert np.all((draws > 0) & (draws < 1))
    assert similarity(estimate) == pytest.approx(float(posterior.log_density.max()), abs=1e-5)
    # The search gets near: a random guess is off by 0.3.
    assert np.abs(estimate - TRUTH).max() < 0.2
    again = infer(jax.random.key(0), similarity, acceptance=acceptance)
    np.testing.assert_array_equal(draws, again.draws)


def test_selection():
    draws = np.array([[[0.1], [0.9]], [[0.4], [0.5]]])
    log_density = np.array([[0.0, 3.0], [1.0, 2.0]])
    chains = Posterior(("k1",), draws, log_density, Status.FIXED_LENGTH)
    assert select(chains, "best") == [0.9]
    assert select(chains, "least_variance") == pytest.approx([0.45])
