"""The formula's search, on sights that are made up: the data see the acceleration itself."""

import re
from dataclasses import replace

import numpy as np
import pytest

from galileo_jax.diagnosis.formula import (
    NOT_SIMPLE,
    NOTHING,
    Sight,
    _matching_pursuit,
    find_formula,
)

NUM_TIMES = 200
NOISE_M_S2 = 0.05


def sight(truth, seed=0):
    """An object speeds up, then slows down; its acceleration is measured at every time."""
    t = np.linspace(0.0, 1.0, NUM_TIMES)
    v = 2.4 * np.minimum(t, 1.0 - t)
    q = np.cumsum(v) * (t[1] - t[0]) - 0.35
    noise = np.random.default_rng(seed).standard_normal(NUM_TIMES)
    target = truth(t, q, v) / NOISE_M_S2 + noise
    gain = float(target @ target) - NUM_TIMES
    return Sight(t, q, v, target, np.eye(NUM_TIMES) / NOISE_M_S2, NUM_TIMES, gain / 2 - 40)


@pytest.mark.parametrize(
    ("truth", "pattern"),
    [
        (lambda t, q, v: -0.62 * v * abs(v), r"v\|v\|"),
        (lambda t, q, v: 0.7 - 1.1 * v, "v"),
        (lambda t, q, v: 0.8 * t, "t"),
        (lambda t, q, v: -1.5 * q, "q"),
        (lambda t, q, v: 0.6 * np.sin(2 * np.pi * q / 0.25), r"sin\(2π q/0\.2[45]\d?\)"),
        (
            lambda t, q, v: 2.0 * np.exp(-(((t - 0.52) / 0.06) ** 2)),
            r"exp\(-\(\(t-0\.5\d\)/0\.06\)²\)",
        ),
    ],
    ids=["drag", "viscous", "heating", "spring", "ripple", "gust"],
)
def test_finds_what_is_there(truth, pattern):
    found = find_formula([sight(truth)])
    assert any(re.fullmatch(pattern, term.text) for term in found.terms)
    assert found.share_explained > 0.95
    made = sight(truth)
    place = made.time_s, made.path_m, made.speed_m_s
    np.testing.assert_allclose(found.curve(*place), truth(*place), atol=4 * NOISE_M_S2)


def test_coefficient_and_text():
    found = find_formula([sight(lambda t, q, v: -0.62 * v * abs(v))])
    assert found.text.startswith("-0.62 v|v|")
    assert found.coefficients == (pytest.approx(-0.62, abs=0.02),)


def test_two_clips_have_one_formula():
    def drag(t, q, v):
        return -0.62 * v * abs(v)

    alone, both = (
        find_formula([sight(drag, seed) for seed in range(count)]).coefficients for count in (1, 2)
    )
    assert len(alone) == len(both) == 1
    assert alone != both


def unseen(log_evidence=-1.0):
    """A clip in which the object is never seen to move: no times, and nothing that could show."""
    none = np.zeros(0)
    target = np.random.default_rng(5).standard_normal(NUM_TIMES)
    return Sight(none, none, none, target, np.zeros((NUM_TIMES, 0)), NUM_TIMES, log_evidence)


def test_what_no_clip_shows_in_motion_has_no_formula():
    found = find_formula([unseen(), unseen()])
    assert (found.text, found.terms, found.share_explained) == (NOTHING, (), 0.0)
    assert find_formula([unseen(log_evidence=50.0)]).text == NOT_SIMPLE


def test_what_never_shows_has_no_formula():
    """Seen to move at some times, but the data do not depend on its acceleration."""
    blind = replace(sight(lambda t, q, v: 0 * t), response=np.zeros((NUM_TIMES, NUM_TIMES)))
    assert find_formula([blind]).text == NOTHING


def test_a_clip_that_does_not_show_the_object_leaves_the_formula_to_the_others():
    def drag(t, q, v):
        return -0.62 * v * abs(v)

    found = find_formula([unseen(), sight(drag)])
    assert found.text.startswith("-0.6") and found.terms[0].text == "v|v|"


def test_nothing_is_nothing():
    found = [find_formula([sight(lambda t, q, v: 0 * t, seed)]) for seed in range(20)]
    assert [formula.text for formula in found] == [NOTHING] * 20
    assert found[0].share_explained == 0.0


def test_what_is_not_simple_is_said_to_be():
    jumps = np.repeat(np.random.default_rng(3).choice([-1.0, 1.0], 20), NUM_TIMES // 20)
    found = find_formula([sight(lambda t, q, v: jumps)])
    assert found.text == NOT_SIMPLE
    assert found.terms == ()
    assert found.share_explained < 0.8


def test_matching_pursuit_takes_what_explains_most_of_what_is_left():
    generator = np.random.default_rng(5)
    columns = np.linalg.qr(generator.standard_normal((40, 9)))[0]
    columns[:, 7] = columns[:, 5] + 0.1 * columns[:, 0]  # much like the first that is chosen
    columns /= np.linalg.norm(columns, axis=0)
    target = -3.0 * columns[:, 5] + 2.0 * columns[:, 1] + columns[:, 8]
    assert _matching_pursuit(columns, target) == [[5], [1, 5], [1, 5, 8]]
    assert _matching_pursuit(columns[:, :1], columns[:, 0]) == [[0]]


def test_rows_that_stand_still_have_no_formula():
    """Nothing at all is left to explain."""
    made = sight(lambda t, q, v: 0 * t)
    still = replace(made, target=np.zeros(NUM_TIMES), free_chi2=0.0, log_evidence=-40.0)
    assert find_formula([still]).text == NOTHING
