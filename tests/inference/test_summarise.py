"""Monte Carlo errors are how far the numbers are off when they are drawn again."""

import numpy as np
import pytest

from galileo_jax.inference.posterior import ESS, Posterior, Status
from galileo_jax.inference.summarise import summarise, summary_of

NUM, AGAIN = 1000, 400


@pytest.mark.parametrize("draw", ["standard_normal", "exponential", "uniform"])
def test_errors_are_the_scatter_of_repeated_draws(draw):
    generator = np.random.default_rng(1)
    found = [summarise(getattr(generator, draw)(size=NUM)) for _ in range(AGAIN)]
    for key, error in found[0]["mcse"].items():
        told = np.sqrt(np.mean([one["mcse"][key] ** 2 for one in found]))
        scatter = np.std([one[key] for one in found])
        assert told == pytest.approx(scatter, rel=0.15), key
        assert error > 0


def test_draws_that_are_worth_less_are_less_sure():
    draws = np.random.default_rng(2).standard_normal(NUM)
    own, less = summarise(draws), summarise(draws, worth=NUM / 4)
    assert less["mcse"]["mean"] == pytest.approx(2 * own["mcse"]["mean"])
    assert less["mcse"]["q025"] > 1.5 * own["mcse"]["q025"]
    assert {key: own[key] for key in ("mean", "sd", "q025", "q975")} == {
        key: less[key] for key in ("mean", "sd", "q025", "q975")
    }


def test_a_chain_is_worth_its_effective_draws_and_weighed_draws_what_they_say():
    generator = np.random.default_rng(3)
    chain = np.zeros((4, 2000))
    for t in range(1, chain.shape[1]):
        chain[:, t] = 0.9 * chain[:, t - 1] + generator.standard_normal(4)
    chains = Posterior(("k",), chain[..., None], np.zeros((4, 2000)), Status.CONVERGED)
    sampled = Posterior(
        ("k",),
        chain[..., None],
        np.zeros((4, 2000)),
        Status.CONVERGED,
        provenance={"sampler": "random_walk"},
    )
    values = chain.reshape(-1)
    assert chains.worth(values) == len(values)
    assert sampled.worth(values) == pytest.approx(len(values) * 0.1 / 1.9, rel=0.4)
    weighed = Posterior(
        ("k",),
        values[None, :, None],
        np.zeros((1, len(values))),
        Status.CONVERGED,
        provenance={ESS: 50.0},
    )
    mcse = summary_of(weighed, values)["mcse"]
    assert mcse["mean"] == pytest.approx(values.std() / 50**0.5, rel=1e-3)


def test_a_constant_has_no_error():
    entry = summarise(np.full(10, 0.3))
    assert entry["mean"] == pytest.approx(0.3)
    assert entry["sd"] == pytest.approx(0, abs=1e-12)
    assert max(entry["mcse"].values()) == pytest.approx(0, abs=1e-12)
