"""What a lab can set: how it is written, what is refused, which settings are looked at."""

import math

import pytest

from galileo_jax.experiment.choose import Expected, sentence_of
from galileo_jax.experiment.settings import (
    KNOWN,
    MOST_SETTINGS,
    Choices,
    Range,
    check_can,
    grid,
    known_as,
    parse_can,
    text_of,
)
from galileo_jax.runtime.errors import InputError


def test_a_call_and_a_lab_say_the_same():
    call = parse_can("height=0.1:0.5, fps=30|60|240,swap")
    lab = parse_can(
        {
            "height": {"low": 0.1, "high": 0.5},
            "fps": {"choices": [30, 60, 240]},
            "swap": {"choices": [0, 1]},
        }
    )
    assert call == lab == parse_can({"height": (0.1, 0.5), "fps": [30, 60, 240], "swap": [0, 1]})
    assert call["height"] == Range(0.1, 0.5) and call["fps"] == Choices((30.0, 60.0, 240.0))


def test_units_at_the_end_of_a_name_are_its_own():
    assert [known_as(name) for name in ("height_m", "angle_deg", "fps", "mass2_kg")] == [
        *("height", "angle", "fps", "mass2")
    ]
    assert known_as("colour_m") == "colour_m"
    assert set(KNOWN) == {known_as(name) for name in KNOWN}


@pytest.mark.parametrize(
    ("can", "complaint"),
    [
        ("hieght=0.1:0.5", r"unknown setting 'hieght'; did you mean height\?; known|known: height"),
        ("height=0.5:0.1", "height: 0.5 to 0.1; the smaller one first"),
        ("height=high", "height: 'high' is not a number"),
        ("height=0.1:0.5,height=1", "height is given twice"),
        ("angle=10:95", "angle: 95.0 is outside 1 to 89 degrees"),
        ("fps=nan", "'nan' is not a number"),
        ("", "nothing given"),
        ({"fps": []}, "fps: no choices"),
        ({"fps": {"from": 1}}, "fps: {low, high} or {choices} expected"),
        ({"fps": ("a", 2.0)}, "two numbers expected"),
    ],
)
def test_what_is_refused(can, complaint):
    with pytest.raises(InputError, match=complaint):
        check_can(parse_can(can))


def test_the_grid_has_the_ends_and_is_not_too_large():
    one = grid(parse_can("height=0.1:0.5"))
    assert len(one) == 9 and one[0] == {"height": 0.1} and one[-1] == {"height": 0.5}
    two = grid(parse_can("height=0.12345:0.5,angle=10:30,fps=30|60"))
    assert 24 <= len(two) <= MOST_SETTINGS
    assert {row["height"] for row in two} >= {0.12345, 0.5}
    assert {row["fps"] for row in two} == {30.0, 60.0}
    many = grid(parse_can("height=0.1:0.5,angle=10:30,place2=0.1:0.4,fps=15|30|60|120|240,swap"))
    assert 24 <= len(many) <= MOST_SETTINGS
    assert many == grid(
        parse_can("height=0.1:0.5,angle=10:30,place2=0.1:0.4,fps=15|30|60|120|240,swap")
    )
    assert len({str(row) for row in many}) == len(many)
    assert {row["swap"] for row in many} == {0, 1}


def test_a_setting_in_words():
    assert text_of({"height_m": 0.15, "fps": 60.0, "swap": 1.0, "colour": "red"}) == (
        "release object 1 from 0.15 m, 60 frames per second, objects swapped, colour red"
    )


def test_with_one_hypothesis_there_is_nothing_to_tell():
    only = Expected({"height": 0.2}, 0.0, 1.0, math.inf, None)
    assert "only one hypothesis is left" in sentence_of(only)
    assert "k2 becomes 1.0 times narrower" in sentence_of(only, "k2")
