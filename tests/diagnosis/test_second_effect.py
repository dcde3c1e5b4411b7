"""A second effect is looked for where its slope promises it, though one effect is enough."""

from typing import Any

import hypothesis.strategies as st
import jax.numpy as jnp
import numpy as np
import pytest
from hypothesis import given
from scipy.special import logsumexp

from galileo_jax.api.simulate import simulate
from galileo_jax.clip.load import load_clip
from galileo_jax.clip.track_csv import read_observation_csv
from galileo_jax.diagnosis import reasons
from galileo_jax.diagnosis.candidates import Hypothesis
from galileo_jax.diagnosis.diagnosis import Promise, Verdict
from galileo_jax.diagnosis.race import Race
from galileo_jax.diagnosis.score_tests import average_gain
from galileo_jax.diagnosis.second_effect import (
    promised_by_a_second,
    promises_of_seconds,
    shares_of_seconds,
    with_second,
)
from galileo_jax.diagnosis.verdict import DECISIVE, log_prior, ranked
from galileo_jax.inference.build_problem import make_joint_problem
from galileo_jax.inference.fits.gradient import GradientFitter
from galileo_jax.model.effects.registry import make_effects
from galileo_jax.model.parameters import LogNormal, Normal
from tests.diagnosis.test_verdict import candidate
from tests.precision import in_64_bit

LIBRARY = ("air_drag", "frame_rate", "restitution")


def promise_in(tmp_path, effects):
    """What a second effect promises in a clip with some hidden, and the best single effect."""
    path = tmp_path / "clip.csv"
    simulate(
        path, seed=11, angle=18.0, effects=effects, track_noise=3e-4, fps=60.0, track_only=True
    )
    clip = load_clip(path.with_suffix(".yaml"))
    trials = make_joint_problem(
        [clip], [read_observation_csv(path)], effects=make_effects(list(LIBRARY))
    )
    with in_64_bit():
        fitter = GradientFitter(trials)
        base = Hypothesis((), fitter.fit(0, effects=()))
        race = Race(fitter, base, False, 0, lambda _: None)
        singles = ranked(race([base] * len(LIBRARY), [(name,) for name in LIBRARY]))
        promises = promises_of_seconds(race, singles, LIBRARY)
        return promised_by_a_second(promises), singles[0]


@pytest.fixture(scope="module")
def two_effects(tmp_path_factory):
    effects = {"air_drag": {"air_drag": 1.0}, "frame_rate": {"frame_rate": 0.05}}
    return promise_in(tmp_path_factory.mktemp("two"), effects)


@given(
    st.lists(st.tuples(st.floats(-5.0, 5.0), st.floats(-3.0, 3.0)), min_size=1, max_size=4),
    st.floats(0.01, 2.0),
    st.floats(0.001, 0.2),
)
def test_the_average_gain_over_a_normal_prior_is_that_of_the_linear_gaussian_model(
    shapes, sd, size
):
    """Per z: slope d, residuals r; averaged, exp(d.r z - d.d z^2/2) is in closed form."""
    sds, log_length = np.array(shapes).T
    length = 10.0**log_length
    along, power = sds * length, length**2
    exact = 0.5 * along**2 / (1 + power) - 0.5 * np.log1p(power)
    per_probe = size / sd
    found = average_gain(along * per_probe, power * per_probe**2, Normal(0.0, sd), size)
    assert found == pytest.approx(logsumexp(exact) - np.log(len(exact)), abs=0.02)


def test_the_average_gain_over_a_positive_prior_is_that_of_its_draws():
    prior, size = LogNormal(0.3, 1.0), 0.05
    z = jnp.asarray(np.random.default_rng(5).normal(size=400_000))
    draws = np.asarray(prior.forward(z)) / size
    along, power = 0.8, 0.04
    drawn = logsumexp(along * draws - 0.5 * power * draws**2) - np.log(len(draws))
    found = average_gain(np.array([along]), np.array([power]), prior, size)
    assert found == pytest.approx(drawn, abs=0.05)


def test_the_second_of_two_effects_promises_more_than_it_costs(two_effects):
    promise, best = two_effects
    assert (best.name, {promise.beside, promise.effect}) == ("air_drag", {"air_drag", "frame_rate"})
    assert promise.nats > promise.price + DECISIVE  # a frame rate wrong by 5 % shows by far
    assert promise.price == pytest.approx(log_prior([1.0], 3) - log_prior([1.0, 1.0], 3))


def test_beside_the_only_effect_nothing_promises_more(tmp_path):
    promise, best = promise_in(tmp_path, {"air_drag": {"air_drag": 1.0}})
    assert promise is None and best.name == "air_drag"


def test_a_library_of_one_effect_has_no_second():
    race: Any = None
    assert promises_of_seconds(race, [], ["air_drag"]) == []


def test_the_reason_names_the_second_effect_and_its_price(two_effects):
    promise, best = two_effects
    why = reasons.pairs_promised(best, promise, 6)
    assert f"{promise.beside} together with {promise.effect}" in why.sentence
    assert "6 pairs" in why.sentence
    assert why.numbers["nats"] == promise.nats and why.numbers["price"] == promise.price


NAMED = candidate("air_drag", 40.0)
PROMISES = [
    Promise("air_drag", "frame_rate", nats=-1.0, price=2.0, gain=0.5),
    Promise("air_drag", "restitution", nats=-3.5, price=2.0, gain=-2.0),
    Promise("rolling", "restitution", nats=5.0, price=2.0, gain=9.0),  # beside another
]


def test_the_probability_of_a_second_effect_is_that_of_all_pairs_with_what_is_named():
    shares = shares_of_seconds(NAMED, [NAMED], PROMISES)
    weights = np.exp([-1.5, -4.0])
    assert list(shares) == ["frame_rate", "restitution"]
    assert list(shares.values()) == pytest.approx(weights / (1 + weights.sum()))


def test_a_pair_that_was_fitted_is_worth_its_fit():
    others = [candidate("restitution+air_drag", 39.0), candidate("rolling+frame_rate", 39.5)]
    shares = shares_of_seconds(NAMED, [NAMED, *others], PROMISES)
    weights = np.exp([-1.5, -1.0])
    assert list(shares.values()) == pytest.approx(weights / (1 + weights.sum()))


def test_a_second_effect_is_said_beside_a_name_if_it_is_probable_enough():
    named = Verdict("named", ("air_drag",))
    (why,) = with_second(named, [NAMED], PROMISES).reasons
    assert why.rule == "second_possible" and why.numbers["second"] == "frame_rate"
    assert why.numbers["probability"] == pytest.approx(0.195, abs=0.001)
    assert "probability 19 %, most likely frame_rate (18 %)" in why.sentence
    assert with_second(named, [NAMED], PROMISES[1:]) == named
    for other in (Verdict("ambiguous", ("air_drag", "rolling")), Verdict("none", ())):
        assert with_second(other, [NAMED], PROMISES) == other
