"""What the reliability benchmark counts as right, and how it scores probabilities."""

import numpy as np
import pytest

from benchmarks import reliability

LIBRARY = ("air_drag", "restitution", "scale_error", "viscous_drag")


def entry(shows: dict[str, float] | str, status: str, effects: str = "", **table: float) -> dict:
    """A case of the journal: by how much each hidden effect shows, and what was said of it."""
    is_outside = isinstance(shows, str)
    seen = "+".join(name for name, nats in shows.items() if nats > 0) if not is_outside else shows
    told = effects.split("+") if status == "named" else effects.split("|")
    return {
        "case": "case0",
        "kind": "outside" if is_outside else ("one", "two")[len(shows) - 1],
        "truth": seen or "none",
        "traces_nats": {} if is_outside else shows,
        "diagnosis": {
            "verdict": {"status": status, "effects": told if effects else []},
            "history": [{"chi2_per_dof": 4.0}, {"chi2_per_dof": 1.0}],
            "candidates": [
                {"effect": name.replace("_and_", "+"), "probability": p}
                for name, p in table.items()
            ],
        },
    }


BOTH = {"air_drag": 40.0, "scale_error": 1.5}


@pytest.mark.parametrize(
    ("shows", "said", "is_right", "is_right_if_it_shows"),
    [
        (BOTH, ("named", "air_drag+scale_error"), True, True),
        (BOTH, ("named", "air_drag"), False, True),
        (BOTH, ("named", "scale_error"), False, False),
        (BOTH, ("named", "air_drag+restitution"), False, False),
        (BOTH | {"scale_error": 4.0}, ("named", "air_drag"), False, False),
        (BOTH | {"scale_error": -1.0}, ("named", "air_drag"), True, True),
        (BOTH | {"scale_error": -1.0}, ("named", "air_drag+scale_error"), False, False),
        ({"scale_error": 1.5}, ("named", "scale_error"), True, True),
        ({"scale_error": 1.5}, ("none",), False, True),
        ({"scale_error": 4.0}, ("none",), False, False),
        ("exotic_gust", ("named", "air_drag"), False, False),
    ],
)
def test_an_effect_that_hardly_shows_may_be_said_or_not(
    shows, said, is_right, is_right_if_it_shows
):
    case = entry(shows, *said)
    assert reliability.judged(case, LIBRARY, 0.0).is_named_right is is_right
    assert reliability.judged(case, LIBRARY, 3.0).is_named_right is is_right_if_it_shows


def test_ambiguous_holds_what_must_be_said():
    case = entry(BOTH, "ambiguous", "air_drag|viscous_drag")
    held = [
        reliability.summary([case], LIBRARY, least)["ambiguous_inside_holds_truth"]
        for least in (0.0, 3.0)
    ]
    assert held == [0, 1]


def test_all_that_has_no_name_is_one_claim():
    table = {"air_drag": 0.5, "drag_of_a_power": 0.2, "force_at_a_time": 0.1, "law_drag_x": 0.15}
    case = entry("exotic_gust", "ambiguous", "air_drag|drag_of_a_power", **table)
    said = reliability._claims(case, LIBRARY, 0.0)
    assert said == [(0.5, False), (pytest.approx(0.45), True)]
    case = entry(BOTH, "law", "law_drag_x", **table)
    assert reliability._claims(case, LIBRARY, 0.0) == [(pytest.approx(0.45), False)]


def test_a_second_effect_that_may_be_there_unseen_counts_where_every_effect_does():
    case = entry(BOTH, "named", "air_drag", air_drag=0.9)
    case["diagnosis"]["reasons"] = [{"rule": "second_possible", "probability": 0.2}]
    assert reliability._claims(case, LIBRARY, 0.0) == [(pytest.approx(0.72), False)]
    assert reliability._claims(case, LIBRARY, 3.0) == [(0.9, True)]


def test_a_claim_is_among_what_the_data_do_not_contradict():
    table = {"viscous_drag": 0.6, "air_drag": 0.2, "force_at_a_time": 0.15}
    case = entry({"air_drag": 40.0}, "ambiguous", "air_drag|force_at_a_time", **table)
    case["diagnosis"]["candidates"][0]["p_value"] = 0.007
    said = reliability._claims(case, LIBRARY, 0.0)
    assert said == [(pytest.approx(0.5), True), (pytest.approx(0.375), False)]
    case["diagnosis"]["candidates"][0]["p_value"] = 0.02
    assert reliability._claims(case, LIBRARY, 0.0) == [(0.2, True), (0.15, False)]


def test_calibration_error():
    probability = np.array([0.92, 0.98, 0.25, 0.25])
    assert reliability.calibration_error(probability, np.ones(4)) == pytest.approx(0.4)
    drawn = np.random.default_rng(1).random(100_000)
    is_true = (np.random.default_rng(2).random(100_000) < drawn).astype(float)
    assert reliability.calibration_error(drawn, is_true) < 0.01
    overconfident = (np.random.default_rng(2).random(100_000) < drawn**2).astype(float)
    # the mean of x - x^2 is 1/6
    assert reliability.calibration_error(drawn, overconfident) == pytest.approx(1 / 6, abs=0.01)


def test_error_of_right_claims_shrinks_with_their_number():
    few, many = (reliability._error_if_right(np.full(count, 0.5)) for count in (10, 1000))
    # |share - 1/2| of n fair coins: sqrt(1 / (2 pi n))
    assert few[0] == pytest.approx(0.126, abs=0.01)
    assert many[0] == pytest.approx(0.0126, abs=0.001)
    assert few[1] > few[0]
