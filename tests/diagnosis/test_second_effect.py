"""A second effect is looked for where its slope promises it, though one effect is enough."""

import pytest

from galileo_jax.api.simulate import simulate
from galileo_jax.clip.load import load_clip
from galileo_jax.clip.track_csv import read_observation_csv
from galileo_jax.diagnosis import reasons
from galileo_jax.diagnosis.candidates import Hypothesis
from galileo_jax.diagnosis.race import Race
from galileo_jax.diagnosis.second_effect import promised_by_a_second
from galileo_jax.diagnosis.verdict import DECISIVE, log_prior, ranked
from galileo_jax.inference.build_problem import make_joint_problem
from galileo_jax.inference.fits.gradient import GradientFitter
from galileo_jax.model.effects.registry import make_effects
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


def test_the_second_of_two_effects_promises_more_than_it_costs(two_effects):
    promise, best = two_effects
    assert (best.name, promise.effect) == ("air_drag", "frame_rate")
    assert promise.nats > promise.price + DECISIVE
    assert promise.price == pytest.approx(log_prior([1.0], 3) - log_prior([1.0, 1.0], 3))


def test_beside_the_only_effect_nothing_promises_more(tmp_path):
    promise, best = promise_in(tmp_path, {"air_drag": {"air_drag": 1.0}})
    assert promise is None and best.name == "air_drag"


def test_the_reason_names_the_second_effect_and_its_price(two_effects):
    promise, best = two_effects
    why = reasons.pairs_promised(best, promise, 6)
    assert promise.effect.replace("_", " ") in why.sentence and "6 pairs" in why.sentence
    assert why.numbers["nats"] == promise.nats and why.numbers["price"] == promise.price
