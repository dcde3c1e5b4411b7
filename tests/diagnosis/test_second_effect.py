"""How probable a second effect is beside one that is named."""

import pytest

from galileo_jax.diagnosis import reasons
from galileo_jax.diagnosis.diagnosis import Verdict
from galileo_jax.diagnosis.second_effect import shares_of_seconds, with_second
from tests.diagnosis.test_verdict import candidate


def test_the_reasons_say_which_pairs_were_looked_at():
    why = reasons.pairs_beside(NAMED, 16, 3)
    assert "16 pairs of effects that come near it were fitted roughly" in why.sentence
    assert "the 3 most probable of them with care" in why.sentence
    assert (why.numbers["num_near"], why.numbers["num_pairs"]) == (16, 3)
    why = reasons.no_pair_contests(NAMED, "air_drag+rolling", 4.4, 16)
    assert "each of them is more than 10 times less probable" in why.sentence  # 81 times
    assert (why.numbers["rival"], why.numbers["log_odds_behind"]) == ("air_drag+rolling", 4.4)
    far = reasons.no_pair_contests(NAMED, "air_drag+rolling", 9.3, 16)
    assert "more than 10^4 times less" in far.sentence


NAMED = candidate("air_drag", 40.0)
NEAR = {
    frozenset(): 0.0,
    frozenset(["air_drag"]): 40.0,
    frozenset(["air_drag", "frame_rate"]): 38.5,
    frozenset(["air_drag", "restitution"]): 36.0,
    frozenset(["rolling", "restitution"]): 47.0,  # beside another
}


def test_the_probability_of_a_second_effect_is_that_of_all_pairs_with_what_is_named():
    shares = shares_of_seconds(NAMED, NEAR)
    total = 1.0 + 0.2231 + 0.0183  # e^-1.5 and e^-4
    assert shares == pytest.approx(
        {"frame_rate": 0.2231 / total, "restitution": 0.0183 / total}, rel=1e-3
    )


def test_a_second_effect_is_said_beside_a_name_if_it_is_probable_enough():
    named = Verdict("named", ("air_drag",))
    weaker = {key: nats for key, nats in NEAR.items() if "frame_rate" not in key}
    (why,) = with_second(named, [NAMED], NEAR).reasons
    assert why.rule == "second_possible" and why.numbers["second"] == "frame_rate"
    assert why.numbers["probability"] == pytest.approx(0.195, abs=0.001)
    assert "probability 19 %, most likely frame_rate (18 %)" in why.sentence
    assert with_second(named, [NAMED], weaker) == named
    for other in (Verdict("ambiguous", ("air_drag", "rolling")), Verdict("none", ())):
        assert with_second(other, [NAMED], NEAR) == other
