"""A second effect is looked for where its slope promises it, though one effect is enough."""

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
from galileo_jax.diagnosis.race import Race
from galileo_jax.diagnosis.score_tests import average_gain
from galileo_jax.diagnosis.second_effect import promised_by_a_second
from galileo_jax.diagnosis.verdict import DECISIVE, log_prior, ranked
from galileo_jax.inference.build_problem import make_joint_problem
from galileo_jax.inference.fits.gradient import GradientFitter
from galileo_jax.model.effects.registry import make_effects
from galileo_jax.model.parameters import LogNormal, Normal
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
        return promised_by_a_second(race, singles, LIBRARY), singles[0]


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


def test_the_reason_names_the_second_effect_and_its_price(two_effects):
    promise, best = two_effects
    why = reasons.pairs_promised(best, promise, 6)
    assert f"{promise.beside} together with {promise.effect}" in why.sentence
    assert "6 pairs" in why.sentence
    assert why.numbers["nats"] == promise.nats and why.numbers["price"] == promise.price
