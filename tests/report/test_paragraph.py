"""The paragraph of a lab report says what the files of a run say, and no more."""

from typing import Any

import pytest

from galileo_jax.report.fit_text import distance_text, error_text, imperfection_text
from galileo_jax.report.paragraph import paragraph

ERROR = {"rms_mm": 0.81, "rms_percent_of_way": 0.21, "chi2_per_dof": 1.0}
CHECK = {"adequate": True, "p_value": 0.42, "noise_misstated": False, "noise_scale": [1.0]}
BAD = CHECK | {"adequate": False, "p_value": 1e-14}


def entry(mean: float, sd: float, unit: str = "1", identified: bool = True) -> dict[str, Any]:
    low, high = mean - 2 * sd, mean + 2 * sd
    named = {"mean": mean, "sd": sd, "q025": low, "q975": high}
    return named | {"unit": unit, "identified": identified}


def result(*effects: str, derived: dict | None = None, **parameters: dict) -> dict[str, Any]:
    return {
        "parameters": parameters,
        "derived": derived or {},
        "error": ERROR,
        "effects": list(effects),
        "clips": ["slide.csv"],
    }


def diagnosis(status: str, effects: list[str], sentence: str, unseen: dict) -> dict[str, Any]:
    return {
        "sentence": sentence,
        "verdict": {"status": status, "effects": effects},
        "could_not_see": unseen,
        "candidates": [{"effect": name} for name in ("air_drag", "rolling", "table_tilt", "magnus",
                                                     "stribeck")],
    }  # fmt: skip


def test_a_block_whose_friction_is_known_and_nothing_is_missing():
    said = paragraph(result(k1=entry(0.29, 0.004)), CHECK, None, ["box"])
    assert said == (
        "The block slid with a friction coefficient of 0.2900 ± 0.0040. The model follows the "
        "motion to 0.81 mm, 0.21 % of the way. What it leaves looks like noise: nothing is "
        "missing (p = 0.42)."
    )


def test_a_mass_that_was_weighed_is_not_called_unknown():
    weighed = {**entry(0.12, 0.0001, "kg"), "identified": False}
    said = paragraph(result(m1=weighed, k1=entry(0.29, 0.004)), CHECK, None, ["box"])
    assert "determine" not in said and "mass" not in said


def test_of_a_ball_that_rolls_it_is_said_why_friction_is_not_known():
    known = result(k1=entry(0.5, 0.3, identified=False), start_speed=entry(1.0, 0.1, "m/s"))
    said = paragraph(known, CHECK, None, ["sphere"], ["marble"], [True])
    assert "The ball rolled without slipping, so that friction does not show. " in said
    assert "determine" not in said
    assert "This clip does not determine the friction" in paragraph(known, CHECK, None, ["sphere"])


@pytest.mark.parametrize(
    ("names", "one", "other"),
    [(["object1", "object2"], "The block", "object 2"), (["cart", "block"], "Cart", "block"),
     (["mass A", "mass B"], "Mass A", "mass B"), (["1", "2"], "The block", "object 2")],
)  # fmt: skip
def test_two_bodies_are_called_as_people_called_them(names, one, other):
    """The second may be the block."""
    known = result(k1=entry(0.1, 0.01), k2=entry(0.2, 0.01), derived={"mass_ratio": entry(1, 0.1)})
    said = paragraph(known, CHECK, None, ["box", "box"], names)
    assert f"{one} slid with a friction coefficient of" in said
    assert f", {other} with" in said and f" times as heavy as {other}." in said


def test_what_is_not_determined_is_said_and_is_given_no_value():
    known = result(
        m1=entry(0.4, 0.1, "kg", False),
        k1=entry(0.1, 0.01),
        m2=entry(0.3, 0.1, "kg", False),
        k2=entry(0.2, 0.01, identified=False),
        derived={"mass_ratio": entry(1.5, 0.02), "phi": entry(0.2, 0.01)},
    )
    said = paragraph(known, CHECK, None, ["box", "box"])
    assert "The block slid with a friction coefficient of 0.100 ± 0.010. " in said
    assert "The block is 1.500 ± 0.020 times as heavy as object 2. " in said
    assert (
        "This clip does not determine the mass of object 1, the mass of object 2 and the friction "
        "coefficient of object 2. "
    ) in said
    assert "0.2 ±" not in said and "0.3 ±" not in said


@pytest.mark.parametrize(
    ("parameters", "said"),
    [
        (
            {"gravity": entry(9.79, 0.03, "m/s^2")},
            "The acceleration of free fall is 9.790 ± 0.030 m/s². ",
        ),
        (
            {"start_velocity_x": entry(2.0, 0.1, "m/s"), "period": entry(1.0, 0.01, "s")},
            "The velocity at the start, along the travel, is 2.00 ± 0.10 m/s; the period of "
            "the swing without damping is 1.000 ± 0.010 s. ",
        ),
        ({}, "The model follows "),
    ],
)
def test_other_quantities_are_called_by_their_meaning(parameters, said):
    assert paragraph(result(**parameters), CHECK, None, ["sphere"]).startswith(said)


def test_an_effect_that_is_named_has_its_strength_and_others_their_limits():
    known = result(
        "air_drag",
        k1=entry(0.148, 0.001),
        air_drag=entry(0.9, 0.5, "kg/m", False),
        derived={"air_drag_per_mass": entry(2.02, 0.02, "1/m")},
    )
    unseen = {
        "rolling": {"strength": None, "unit": "1"},
        "table_tilt": {"strength": 0.011, "unit": "rad"},
        "magnus": {"strength": 0.0502, "unit": "1/m"},
        "stribeck": {"strength": 0.2, "unit": "1"},
    }
    found = diagnosis("named", ["air_drag"], "air_drag explains the data (p < 1e-12).", unseen)
    said = paragraph(known, BAD, found, ["box"])
    assert "The air drag over the mass is 2.020 ± 0.020 /m. " in said
    assert "The model with air drag follows" in said
    assert "does not determine" not in said, "it is known per mass"
    assert said.endswith(
        "Rolling of any usual strength, table tilt below 0.011 rad and magnus below 0.05 /m could "
        "not have been seen."
    )


def test_where_nothing_is_missing_it_is_said_what_could_not_have_been_seen():
    unseen = {
        "air_drag": {"strength": 0.0186, "unit": "1/m"},
        "magnetic_brake": {"strength": 278.4, "unit": "1/s"},
    }
    said = paragraph(result(k1=entry(0.29, 0.004)), {**CHECK, "could_not_see": unseen}, None)
    assert said.endswith(
        "Air drag below 0.019 /m and magnetic brake below 280 /s could not have been seen."
    )


def test_what_would_change_a_number_most_is_said_first_and_of_every_number_one():
    def change(by, sds):
        return {"by": by, "sds": sds}

    unseen = {
        "air_drag": {"strength": 0.02, "usual": 1.0, "unit": "1/m", "changes": {}},
        "restitution": {
            "strength": 0.326,
            "usual": 0.84,
            "unit": "1",
            "changes": {"k2": change(0.11, 8.4)},
        },
        "table_tilt": {
            "strength": 0.02,
            "usual": 0.03,
            "unit": "rad",
            "changes": {"k2": change(-0.04, -3.0), "k1": change(0.001, 1.1)},
        },
        "frame_rate": {
            "strength": None,
            "usual": 0.07,
            "unit": "1",
            "changes": {"k1": change(-0.02, -30.0)},
        },
        "static_friction": {  # no usual one is so strong
            "strength": 30.0,
            "usual": 0.3,
            "unit": "1",
            "changes": {"k1": change(0.9, 1000.0)},
        },
    }
    said = paragraph(result(k1=entry(0.29, 0.004)), {**CHECK, "could_not_see": unseen}, None)
    assert said.endswith(
        "Frame rate of any usual strength (7 % would change k1 by 0.02), restitution below 0.33 "
        "(k2 by 0.11) and static friction below 30 (k1 by 0.9) could not have been seen."
    )


def test_what_is_a_share_of_something_declared_is_said_in_per_cent():
    unseen = {name: {"strength": 0.0141, "unit": "1"} for name in ("frame_rate", "scale_error")}
    said = paragraph(result(k1=entry(0.29, 0.004)), {**CHECK, "could_not_see": unseen}, None)
    assert said.endswith(
        "A frame rate that is off by less than 1.4 % and a scale that is off by less than 1.4 % "
        "could not have been seen."
    )


def test_of_several_explanations_the_values_are_those_with_one_of_them():
    known = result("rolling", k1=entry(0.1, 0.01), rolling=entry(0.2, 0.05))
    unseen = {name: {"strength": 1.0, "unit": "1"} for name in ("air_drag", "table_tilt")}
    effects = ["rolling", "table_tilt+air_drag"]
    found = diagnosis("ambiguous", effects, "This clip cannot distinguish between them.", unseen)
    said = paragraph(known, BAD, found, ["box"])
    assert "All values are those with rolling." in said
    assert "could not have been seen" not in said, "both are in question themselves"
    for k1, is_said in ((0.11, False), (0.2, True)):
        found["candidates"] = [{"effect": effects[1], "parameters": {"k1": entry(k1, 0.01)}}]
        other = "rolling; with table tilt and air drag k1 is 0.200 ± 0.010."
        assert (other in paragraph(known, BAD, found, ["box"])) == is_said


def test_what_cannot_be_by_what_is_declared_is_said_first():
    doubt = "from ball's path gravity would be 4.9 m/s^2, not 9.81; likely fps: 42"
    said = paragraph(result(k1=entry(0.1, 0.01)) | {"impossible": [doubt]}, CHECK, None, ["box"])
    assert said.startswith(
        f"Check first: {doubt}. Until that is settled, what follows is no result. The block slid"
    )


def test_a_law_has_its_constants_in_its_formula():
    known = result("law_t", k1=entry(0.1, 0.01), law_t=entry(0.2, 0.05))
    found = diagnosis("law", ["law_t"], "No known effect explains it; a law does: a = 0.2 t.", {})
    said = paragraph(known, BAD, found, ["box"])
    assert "The model with a law follows" in said and "0.20 ±" not in said
    assert said.endswith("a = 0.2 t.")


@pytest.mark.parametrize(
    ("check", "more", "said"),
    [
        (BAD, {}, "The data contradict the model (p < 1e-12)."),
        (CHECK | {"rests_on_imperfections": True}, {}, "imperfections; an effect may be better."),
        (CHECK | {"adequate": None}, {"no_verdict": "a.yaml: only 5 frames"}, "only 5 frames."),
        (
            CHECK | {"noise_misstated": True, "noise_scale": [3.04]},
            {},
            "The tracking errors are 3.0 times as large as stated.",
        ),
    ],
)
def test_the_end_says_whether_the_model_will_do(check, more, said):
    assert paragraph(result(k1=entry(0.1, 0.01)) | more, check, None, ["box"]).endswith(said)


def test_a_distance_that_nobody_knows_is_not_told():
    known = result(k1=entry(0.1, 0.01)) | {"error": {"rms_mm": None, "rms_percent_of_way": None}}
    assert "follows" not in paragraph(known, CHECK, None, ["torus"])
    assert paragraph(known, CHECK, None, ["torus"]).startswith("The ring moved with a friction")


def test_frames_are_told_where_no_distance_is_known():
    assert distance_text({"frames_used": 35, "frames": 120}) == "The fit uses 35 of 120 frames."
    said = distance_text({"rms_mm": 2.0, "frames_used": 35, "frames": 120})
    assert said == "The fit is 2 mm off (root mean square), in 35 of 120 frames."


@pytest.mark.parametrize(("size", "said"), [(2.5e-6, "0.0025 mm"), (0.02, "0.02 m")])
def test_small_sizes_are_said_in_thousandths(size, said):
    found = {"brief_error": entry(size, 0.0) | {"unit": "m", "meaning": "off by {size}"}}
    found["brief_error"] |= {"ordinary": False}
    assert imperfection_text(found, {}) == [f"Off by {said}, which is more than usual."]


@pytest.mark.parametrize(("size_m", "is_told"), [(3e-4, False), (6e-4, True)])
def test_an_error_of_the_marks_far_below_what_is_left_is_not_told(size_m, is_told):
    sizes = {"mean": size_m, "q025": 0.8 * size_m, "q975": 1.2 * size_m, "unit": "m"}
    found = {"lasting_error": {**sizes, "ordinary": True, "meaning": "the marks are off by {size}"}}
    assert bool(imperfection_text(found, {"rms_mm": 5.0})) == is_told


@pytest.mark.parametrize("rmse", [None, float("nan")])
def test_where_no_two_frames_follow_each_other_there_is_no_velocity(rmse) -> None:
    error = {"chi2_per_dof": 1.0, "rmse": rmse, "noise": rmse}
    assert error_text(error) == "chi2 per degree of freedom 1.00"
    assert "velocity error 0.0100 m/s" in error_text(error | {"rmse": 0.01, "noise": 0.02})
