"""Every sampler on densities with known moments; the registry; BlackJAX's argument order."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy import stats

from galileo_jax.inference.convergence import convergence
from galileo_jax.inference.samplers.driver import Settings, sample
from galileo_jax.inference.samplers.sampler import (
    SAMPLERS,
    State,
    TunedSampler,
    metropolis_hastings,
)
from tests.inference.samplers.targets import (
    APART,
    WEIGHTS,
    Target,
    dispersed_starts,
    gaussian,
    gumbel_and_logistic,
    two_valleys,
)

TUNED = ("mixture", "random_walk")
TARGETS = {"gaussian": gaussian(), "gumbel_logistic": gumbel_and_logistic()}
MONTE_CARLO_ERRORS = 5.0  # about thirty comparisons in this file


def tuned(name: str, mean, covariance) -> TunedSampler:
    return SAMPLERS[name].from_gaussian(jnp.asarray(mean), jnp.asarray(covariance))


def run(name: str, target: Target, seed: int = 0, **settings):
    start_key, key = jax.random.split(jax.random.key(seed))
    start = dispersed_starts(start_key, jnp.asarray(target.mean), jnp.asarray(target.covariance), 8)
    # A covariance that is wrong by a factor of four and knows no correlation.
    wrong = np.diag(np.diag(target.covariance)) / 4
    names = [f"z{i}" for i in range(len(target.mean))]
    return sample(
        key,
        tuned(name, target.mean, wrong),
        target.log_density,
        start,
        names,
        settings=Settings(**settings),
    )


def test_registry():
    assert SAMPLERS.names() == ("mixture", "random_walk")
    with pytest.raises(ValueError, match="unknown sampler 'nuts'; known: mixture, random_walk"):
        SAMPLERS.get("nuts")


@pytest.mark.parametrize("name", TUNED)
@pytest.mark.parametrize("target", TARGETS)
def test_moments(name, target):
    known = TARGETS[target]
    posterior = run(name, known, block_steps=100, min_ess=1500)
    assert posterior.is_converged
    for i, name_of_one in enumerate(posterior.names):
        sd, draws = np.sqrt(known.covariance[i, i]), posterior[name_of_one]
        found = convergence(draws)
        assert found.rhat < 1.01
        assert found.ess_bulk >= 1500
        off = abs(draws.mean() - known.mean[i])
        assert off < MONTE_CARLO_ERRORS * sd / np.sqrt(found.ess_bulk)
        # Squared deviations mix more slowly than the mean and have up to twice its kurtosis.
        assert draws.std() / sd == pytest.approx(1, abs=MONTE_CARLO_ERRORS * 2 / np.sqrt(2 * 1500))
    correlation = np.corrcoef(posterior.flat(), rowvar=False)
    expected = known.covariance / np.sqrt(
        np.outer(np.diag(known.covariance), np.diag(known.covariance))
    )
    np.testing.assert_allclose(correlation, expected, atol=MONTE_CARLO_ERRORS / np.sqrt(1000))


def test_two_valleys_have_their_weights():
    """Chains that all start in the wider valley find the narrow one, and its share of the draws."""
    known = two_valleys()
    posterior = sample(
        jax.random.key(2),
        tuned("mixture", np.zeros(4, np.float32), np.eye(4, dtype=np.float32)),
        known.log_density,
        0.1 * jax.random.normal(jax.random.key(3), (8, 4)),
        ["z0", "z1", "z2", "z3"],
        settings=Settings(min_ess=1500),
    )
    assert posterior.is_converged
    in_second = posterior["z0"] > 0.6 * APART
    # Of the wider valley two in a hundred lie beyond, and of the narrow one as many before.
    expected = WEIGHTS[0] * stats.norm.sf(0.6 * APART) + WEIGHTS[1] * stats.norm.cdf(0.8 * APART)
    error = np.sqrt(expected * (1 - expected) / convergence(in_second.astype(float)).ess_bulk)
    assert abs(in_second.mean() - expected) < MONTE_CARLO_ERRORS * error
    assert error < 0.02


@pytest.mark.parametrize("name", TUNED)
def test_warm_up_learns_the_scale(name):
    posterior = run(name, gaussian(8), max_steps=500, stops_early=False)
    rate = posterior.stats["acceptance_rate"]
    assert 0.15 < rate < 0.35 if name == "random_walk" else 0.4 < rate < 0.85


def chain_of_gamma(log_q, num_chains=4000, num_steps=40):
    """Samples Gamma(3) with the asymmetric proposal y = x exp(e), e ~ N(0, 1)."""

    def log_density(z):
        return jnp.where(z[0] > 0, 2 * jnp.log(jnp.abs(z[0])) - z[0], -jnp.inf)

    def propose(key, x):
        return x * jnp.exp(jax.random.normal(key, x.shape))

    def one(key):
        start = State(jnp.array([2.0]), log_density(jnp.array([2.0])))

        def body(state, key):
            return metropolis_hastings(key, state, log_density, propose, log_q)[0], None

        return jax.lax.scan(body, start, jax.random.split(key, num_steps))[0].position[0]

    return jax.jit(jax.vmap(one))(jax.random.split(jax.random.key(5), num_chains))


def log_normal_step(x, y):
    return jnp.sum(-0.5 * jnp.log(y / x) ** 2 - jnp.log(y))


def test_asymmetric_proposals_keep_the_density():
    """One draw of each of many independent chains: an exact test, no autocorrelation."""
    draws = np.asarray(chain_of_gamma(log_normal_step))
    assert stats.kstest(draws, stats.gamma(3).cdf).pvalue > 1e-3


def test_swapped_arguments_would_be_noticed():
    swapped = np.asarray(chain_of_gamma(lambda x, y: log_normal_step(y, x)))
    assert stats.kstest(swapped, stats.gamma(3).cdf).pvalue < 1e-12


@pytest.mark.parametrize("name", TUNED)
def test_invariance_of_the_kernels(name):
    """Chains that start in the density are still in it after any number of steps.

    The proposals fit badly on purpose, so that a wrong ratio would show.
    """
    num_chains = 4000
    starts = np.random.default_rng(2).gumbel(size=(num_chains, 1)).astype(np.float32)
    sampler = tuned(name, np.array([1.0], np.float32), np.array([[0.5]], np.float32))

    def log_density(z):
        return -z[0] - jnp.exp(-z[0])

    def one(key, start):
        def body(state, key):
            state, (_, info) = sampler.turn(key, state, log_density)
            return state, info.is_accepted

        state = sampler.init(start, log_density)
        state, is_accepted = jax.lax.scan(body, state, jax.random.split(key, 20))
        return state.position[0], is_accepted.mean()

    keys = jax.random.split(jax.random.key(7), num_chains)
    draws, accepted = jax.jit(jax.vmap(one))(keys, jnp.asarray(starts))
    assert 0.2 < accepted.mean() < 0.9
    assert stats.kstest(np.asarray(draws), stats.gumbel_r.cdf).pvalue > 1e-3


def test_a_turn_is_its_steps():
    """What it says of every step: where the chain went, and that each move was one it accepted."""
    target = gaussian(3)
    sampler = tuned("mixture", target.mean, target.covariance)
    state = sampler.init(jnp.asarray(target.mean), target.log_density)
    keys = jax.random.split(jax.random.key(1), 50)
    last, (states, info) = jax.vmap(lambda key: sampler.turn(key, state, target.log_density))(keys)
    assert states.position.shape == (50, sampler.steps_per_turn, 3)
    np.testing.assert_array_equal(states.position[:, -1], last.position)
    start = jnp.broadcast_to(state.position, (50, 1, 3))
    moved = np.any(np.diff(states.position, axis=1, prepend=start) != 0, axis=-1)
    np.testing.assert_array_equal(moved, info.is_accepted)
    densities = jax.vmap(jax.vmap(target.log_density))(states.position)
    np.testing.assert_allclose(states.log_density, densities, atol=1e-4)


def simulated_ranks(num_runs: int, draws_per_run: int) -> np.ndarray:
    """Ranks of the truth among posterior draws, conjugate Gaussian: `[run, parameter]`.

    theta ~ N(0, I), y = A theta + N(0, 0.5^2); Talts et al. 2018, arXiv 1804.06788.
    """
    rng = np.random.default_rng(11)
    design = rng.normal(size=(6, 2)).astype(np.float32)
    sampler = tuned("mixture", np.zeros(2, np.float32), np.eye(2, dtype=np.float32) / 10)
    turns = 4  # from a draw to the next

    def one(key):
        theta_key, noise_key, start_key, key = jax.random.split(key, 4)
        theta = jax.random.normal(theta_key, (2,))
        y = design @ theta + 0.5 * jax.random.normal(noise_key, (6,))

        def log_density(z):
            return -0.5 * z @ z - 0.5 * jnp.sum((y - design @ z) ** 2) / 0.25

        def body(state, key):
            state, _ = sampler.turn(key, state, log_density)
            return state, state.position

        state = sampler.init(jax.random.normal(start_key, (2,)), log_density)
        keys = jax.random.split(key, turns * (draws_per_run + 20))
        _, positions = jax.lax.scan(body, state, keys)
        kept = positions[20 * turns :: turns]
        return jnp.sum(kept < theta, axis=0)

    return np.asarray(jax.jit(jax.vmap(one))(jax.random.split(jax.random.key(3), num_runs)))


@pytest.mark.parametrize(
    "num_runs", [200, pytest.param(4000, marks=pytest.mark.slow)], ids=["small", "large"]
)
def test_simulation_based_calibration(num_runs):
    num_draws, num_bins = 99, 10
    ranks = simulated_ranks(num_runs, num_draws)
    for parameter in range(2):
        counts, _ = np.histogram(ranks[:, parameter], bins=num_bins, range=(0, num_draws + 1))
        assert stats.chisquare(counts).pvalue > 1e-3
