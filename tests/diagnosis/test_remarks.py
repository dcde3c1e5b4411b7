"""What the data alone say of the power that the name of a drag takes for known."""

from typing import Any

import pytest

from galileo_jax.api.simulate import simulate
from galileo_jax.assembly.build_problem import make_joint_problem
from galileo_jax.clip.load import load_clip
from galileo_jax.clip.track_csv import read_observation_csv
from galileo_jax.diagnosis.candidates import candidates_of
from galileo_jax.diagnosis.diagnosis import Verdict
from galileo_jax.diagnosis.reasons import because
from galileo_jax.diagnosis.remarks import shares_of_seconds, with_known_constants, with_second
from galileo_jax.diagnosis.stakes import VerdictStakes
from galileo_jax.inference.fits.gradient import GradientFitter
from galileo_jax.model.effects.forms import FORMS
from galileo_jax.model.effects.registry import effect_names, make_effects
from galileo_jax.search.fit import best_fit
from galileo_jax.search.hypothesis import Hypothesis
from galileo_jax.search.loop import search
from galileo_jax.search.table import Table
from tests.diagnosis.test_verdict import candidate

FORM = next(form for form in FORMS if form.name == "drag_of_a_power")
NAMED = Verdict("named", ("viscous_drag",))


def judged(tmp_path, noise_m):
    """The verdict on a track with linear drag, and what the table says of form over name."""
    path = tmp_path / "clip.csv"
    effects = {"viscous_drag": {"viscous_drag": 0.3}}
    simulate(
        path, seed=3, angle=20.0, effects=effects, track_noise=noise_m, fps=60.0, track_only=True
    )
    clip = load_clip(path.with_suffix(".yaml"))
    both = (*make_effects(["viscous_drag"]), FORM)
    trials = make_joint_problem([clip], [read_observation_csv(path)], effects=both)
    fitter = GradientFitter(trials)
    base = Hypothesis((), best_fit(fitter, 0, effects=()))
    stakes = VerdictStakes(trials, False)
    table = candidates_of(search(Table.of(fitter, stakes, 0, base), 1))
    evidence = {c.name: c.log_evidence for c in table}
    ahead = evidence["viscous_drag"] - evidence[FORM.name]
    return with_known_constants(trials, NAMED, table, 0), ahead


def test_where_a_clip_hardly_tells_the_power_its_interval_is_said(tmp_path):
    found, ahead = judged(tmp_path, 1e-3)
    assert ahead < 3
    (why,) = found.reasons
    numbers: Any = why.numbers
    assert why.rule == "constant_by_data" and numbers["value"] == 1
    assert numbers["low"] < 1 < numbers["high"]
    assert numbers["high"] - numbers["low"] > 0.3
    assert "the power of the speed is 1; from these data alone" in why.sentence


def test_where_a_clip_tells_the_power_nothing_is_said(tmp_path):
    found, ahead = judged(tmp_path, 5e-6)
    assert ahead > 3 and found.reasons == ()


@pytest.mark.parametrize(
    "verdict",
    [Verdict("ambiguous", ("viscous_drag", FORM.name)), Verdict("named", ("stribeck", "rolling"))],
)
def test_other_verdicts_stay_as_they_are(verdict):
    trials: Any = None  # nothing is asked of them
    assert with_known_constants(trials, verdict, (), 0) is verdict


def test_forms_are_those_of_effects_that_there_are():
    for form in FORMS:
        assert set(form.named_values) <= set(effect_names())
        assert bool(form.named_values) == bool(form.constant) == bool(form.constant_words)


def test_the_reasons_say_which_pairs_were_looked_at():
    why = because("pairs_beside", AIR_DRAG, num_near=16, num_pairs=3)
    assert "16 pairs of effects that come near it were fitted roughly" in why.sentence
    assert "the 3 most probable of them with care" in why.sentence
    assert (why.numbers["num_near"], why.numbers["num_pairs"]) == (16, 3)
    near: dict[str, Any] = {"rival": "air_drag+rolling", "log_odds_behind": 4.4, "num_near": 16}
    why = because("no_pair_contests", AIR_DRAG, **near)
    assert "each of them is more than 10 times less probable" in why.sentence  # 81 times
    assert (why.numbers["rival"], why.numbers["log_odds_behind"]) == ("air_drag+rolling", 4.4)
    near["log_odds_behind"] = 9.3
    far = because("no_pair_contests", AIR_DRAG, **near)
    assert "more than 10^4 times less" in far.sentence


AIR_DRAG = candidate("air_drag", 40.0)
NEAR = {
    frozenset(): 0.0,
    frozenset(["air_drag"]): 40.0,
    frozenset(["air_drag", "frame_rate"]): 38.5,
    frozenset(["air_drag", "restitution"]): 36.0,
    frozenset(["rolling", "restitution"]): 47.0,  # beside another
}


def test_the_probability_of_a_second_effect_is_that_of_all_pairs_with_what_is_named():
    shares = shares_of_seconds(AIR_DRAG, NEAR)
    total = 1.0 + 0.2231 + 0.0183  # e^-1.5 and e^-4
    assert shares == pytest.approx(
        {"frame_rate": 0.2231 / total, "restitution": 0.0183 / total}, rel=1e-3
    )


def test_a_second_effect_is_said_beside_a_name_if_it_is_probable_enough():
    named = Verdict("named", ("air_drag",))
    weaker = {key: nats for key, nats in NEAR.items() if "frame_rate" not in key}
    (why,) = with_second(named, [AIR_DRAG], NEAR).reasons
    assert why.rule == "second_possible" and why.numbers["second"] == "frame_rate"
    assert why.numbers["probability"] == pytest.approx(0.195, abs=0.001)
    assert "probability 19 %, most likely frame_rate (18 %)" in why.sentence
    assert with_second(named, [AIR_DRAG], weaker) == named
    for other in (Verdict("ambiguous", ("air_drag", "rolling")), Verdict("none", ())):
        assert with_second(other, [AIR_DRAG], NEAR) == other
