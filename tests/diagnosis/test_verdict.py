"""The rules of the verdict, on candidates made by hand: each threshold, at and just beside it.

Thresholds stand here as plain numbers, not imported: whoever changes one changes a promise.
"""

from dataclasses import replace

import numpy as np
import pytest

from galileo_jax.diagnosis.candidates import Hypothesis
from galileo_jax.diagnosis.diagnosis import Candidate, Verdict
from galileo_jax.diagnosis.pairs import pairs_with, with_largest_scores
from galileo_jax.diagnosis.verdict import (
    best_named,
    decisive_margin,
    explains,
    is_nothing_missing,
    probabilities,
    rivals,
    to_add,
    to_compare,
    verdict_of,
    verdict_of_pairs,
)
from galileo_jax.inference.fits.gradient import Code, GradientFit
from galileo_jax.model.effects.forms import FORM_NAMES

FORM, OTHER_FORM = FORM_NAMES[:2]
EDGE = 1e-6  # just beside a threshold
NUM_VALUES = 1000
BASE_MISFIT = 4.0  # of the model without effects: chi2 per value is 5
DECISIVE = 3.0


def candidate(
    name: str, log_evidence: float, p_value: float | None = 0.5, misfit: float = 1.0
) -> Candidate:
    """One hypothesis; `name` may be several, joined by +. Its misfit is no small one."""
    effects = tuple(name.split("+"))
    none = np.zeros(0)
    fit = GradientFit(
        z=none,
        free=np.zeros(0, bool),
        covariance=np.zeros((0, 0)),
        chi2=NUM_VALUES * (1.0 + misfit),
        log_evidence=log_evidence,
        num_values=NUM_VALUES,
        steps=none,
        jacobian=np.zeros((NUM_VALUES, 0)),
        code=Code.CONVERGED,
        stats={},
        pull=0.0,
    )
    return Candidate(effects, Hypothesis(effects, fit), {}, 5.0, log_evidence, 0.5, p_value, ())


def verdict(*candidates: Candidate, decisive: float = DECISIVE) -> Verdict | None:
    """Of candidates in any order."""
    ranked = sorted(candidates, key=lambda c: -c.log_evidence)
    return verdict_of(ranked, BASE_MISFIT, decisive)


# Named and ambiguous.


def test_the_only_one_that_explains_is_named():
    found = verdict(candidate("air_drag", 40.0), candidate("rolling", 39.0, p_value=1e-9))
    assert found == Verdict("named", ("air_drag",))


def test_one_that_was_not_compared_is_no_rival():
    assert verdict(candidate("air_drag", 40.0), candidate("rolling", 39.0, None)) == Verdict(
        "named", ("air_drag",)
    )


@pytest.mark.parametrize(
    ("behind", "status", "effects"),
    [
        (3.0 - EDGE, "ambiguous", ("air_drag", "rolling")),
        (3.0, "named", ("air_drag",)),
        (3.0 + EDGE, "named", ("air_drag",)),
    ],
)
def test_of_two_that_explain_one_is_named_if_the_other_is_decisively_behind(
    behind, status, effects
):
    found = verdict(
        candidate("air_drag", 40.0),
        candidate("rolling", 40.0 - behind),
        decisive=decisive_margin(False),
    )
    assert found == Verdict(status, effects)


@pytest.mark.parametrize(("behind", "status"), [(6.0 - EDGE, "ambiguous"), (6.0, "named")])
def test_the_margin_is_twice_as_wide_where_the_base_is_adequate(behind, status):
    found = verdict(
        candidate("air_drag", 40.0),
        candidate("rolling", 40.0 - behind),
        decisive=decisive_margin(True),
    )
    assert found is not None and found.status == status


def test_a_better_one_that_does_not_explain_rules_out_the_one_that_does():
    def found(ahead):
        return verdict(
            candidate("air_drag", 40.0), candidate("rolling", 40.0 + ahead, p_value=1e-9)
        )

    assert found(3.0) == Verdict("named", ("air_drag",))
    assert found(3.0 + EDGE) is None


def test_that_one_need_not_have_been_compared():
    assert verdict(candidate("air_drag", 40.0), candidate("rolling", 43.1, None)) is None


def test_less_probable_than_no_effect_is_no_verdict():
    assert verdict(candidate("air_drag", 0.0)) == Verdict("named", ("air_drag",))
    assert verdict(candidate("air_drag", -EDGE)) is None


# What explains the data.


@pytest.mark.parametrize(("p_value", "is_explained"), [(1e-5, True), (0.99e-5, False)])
def test_the_least_p_value_that_explains(p_value, is_explained):
    assert explains(candidate("air_drag", 40.0, p_value), BASE_MISFIT) is is_explained


@pytest.mark.parametrize(("share", "is_explained"), [(0.00999, True), (0.01001, False)])
def test_or_the_largest_share_of_the_misfit_that_may_be_left(share, is_explained):
    almost = candidate("air_drag", 40.0, p_value=1e-30, misfit=share * BASE_MISFIT)
    assert explains(almost, BASE_MISFIT) is is_explained
    assert (verdict(almost) is not None) is is_explained


def test_without_a_misfit_of_the_base_there_is_no_share_of_it():
    """Less than no misfit is left, but none was there."""
    assert not explains(candidate("air_drag", 40.0, 1e-30, misfit=-0.5), base_misfit=-0.1)
    assert not explains(candidate("air_drag", 40.0, 1e-30, misfit=-0.5), base_misfit=0.0)


def test_what_was_not_compared_explains_nothing():
    assert not explains(candidate("air_drag", 40.0, None, misfit=0.0), BASE_MISFIT)


# Forms without a name, and unknown.


def test_only_a_form_explains():
    wrong = candidate("air_drag", 60.0, p_value=1e-9)
    assert verdict(candidate(FORM, 59.0), wrong) == Verdict("unknown", (), FORM)


def test_nothing_explains():
    wrong = candidate("air_drag", 60.0, p_value=1e-9)
    assert verdict(wrong, candidate(FORM, 59.0, p_value=1e-3)) is None
    assert verdict(wrong) is None


@pytest.mark.parametrize(
    ("ahead", "expected"),
    [
        (3.0 + EDGE, Verdict("unknown", (), FORM)),
        (3.0 - EDGE, Verdict("ambiguous", ("air_drag", FORM))),
        (-3.0 + EDGE, Verdict("ambiguous", ("air_drag", FORM))),
        (-3.0 - EDGE, Verdict("named", ("air_drag",))),
    ],
)
def test_a_form_against_a_name(ahead, expected):
    assert verdict(candidate("air_drag", 40.0), candidate(FORM, 40.0 + ahead)) == expected


@pytest.mark.parametrize(
    ("p_value", "expected"),
    [(0.01, Verdict("unknown", (), FORM)), (0.0099, Verdict("named", ("air_drag",)))],
)
def test_a_form_must_be_adequate_itself(p_value, expected):
    """What is allowed to a name (a tiny p-value, a small share of the misfit) is not to a form."""
    form = candidate(FORM, 60.0, p_value, misfit=0.0)
    assert verdict(candidate("air_drag", 40.0), form) == expected


def test_one_form_stands_last_in_an_ambiguous_verdict():
    """Also where it is the best, and however many there are."""
    found = verdict(
        candidate(FORM, 42.0),
        candidate("air_drag", 41.0),
        candidate("rolling", 40.0),
        candidate(OTHER_FORM, 39.5),
    )
    assert found == Verdict("ambiguous", ("air_drag", "rolling", FORM))


# None.


@pytest.mark.parametrize(
    ("is_adequate", "log_evidence", "is_none"),
    [(True, 10.0 - EDGE, True), (True, 10.0, False), (False, -5.0, False)],
)
def test_nothing_is_missing_where_the_base_is_adequate_and_nothing_convinces(
    is_adequate, log_evidence, is_none
):
    candidates = (candidate("air_drag", log_evidence, None), candidate("rolling", -9.0, None))
    assert is_nothing_missing(is_adequate, candidates) is is_none


def test_a_form_alone_does_not_convince():
    candidates = (candidate(FORM, 30.0, None), candidate("air_drag", 9.0, None))
    assert best_named(candidates).name == "air_drag"
    assert is_nothing_missing(True, candidates)


# Pairs.

SINGLE = candidate("air_drag", 40.0, p_value=1e-9)
PAIR = "air_drag+rolling"


@pytest.mark.parametrize(
    ("gain", "expected"),
    [(10.0 + EDGE, Verdict("named", ("air_drag", "rolling"))), (10.0, Verdict("unknown", ()))],
)
def test_a_pair_must_gain(gain, expected):
    pair = candidate(PAIR, 40.0 + gain)
    assert verdict_of_pairs((pair,), SINGLE, BASE_MISFIT, DECISIVE) == expected


@pytest.mark.parametrize(
    ("p_value", "status"), [(0.05, "named"), (0.0499, "unknown"), (None, "unknown")]
)
def test_a_pair_must_leave_nothing(p_value, status):
    pair = candidate(PAIR, 60.0, p_value, misfit=0.0)
    assert verdict_of_pairs((pair,), SINGLE, BASE_MISFIT, DECISIVE).status == status


@pytest.mark.parametrize("p_value", [0.04, None])
def test_it_is_the_best_pair_that_must(p_value):
    pairs = (candidate(PAIR, 60.0, p_value), candidate("air_drag+stribeck", 59.0, 0.9))
    assert verdict_of_pairs(pairs, SINGLE, BASE_MISFIT, DECISIVE) == Verdict("unknown", ())


@pytest.mark.parametrize(("behind", "status"), [(3.0 - EDGE, "ambiguous"), (3.0, "named")])
def test_pairs_can_be_ambiguous(behind, status):
    pairs = (candidate(PAIR, 60.0), candidate("air_drag+stribeck", 60.0 - behind))
    found = verdict_of_pairs(pairs, SINGLE, BASE_MISFIT, DECISIVE)
    assert found.status == status
    if status == "ambiguous":
        assert found.effects == (PAIR, "air_drag+stribeck")


def test_where_there_is_no_other_effect_there_is_no_pair():
    assert verdict_of_pairs((), SINGLE, BASE_MISFIT, DECISIVE) == Verdict("unknown", ())


def test_the_best_is_paired_with_all_others():
    library = ["air_drag", "rolling", "stribeck"]
    assert pairs_with(SINGLE, library) == [("air_drag", "rolling"), ("air_drag", "stribeck")]


def test_eight_pairs_are_tried_those_with_the_largest_scores():
    pairs = [("air_drag", f"effect{i}") for i in range(10)]
    scores = np.array([5.0, 1.0, 9.0, 3.0, 0.5, 7.0, 2.0, 8.0, 6.0, 4.0])
    found = with_largest_scores(pairs, scores)
    assert [name for _, name in found] == [f"effect{i}" for i in (2, 7, 5, 8, 0, 9, 3, 6)]


# Which are compared, and which cannot be told apart.


def compared(*candidates: Candidate) -> list[str]:
    return [c.name for c in to_compare(candidates)]


def test_what_is_near_the_best_is_compared():
    near, far = (candidate(f"at{b}", 40.0 - b, None) for b in (6.0 - EDGE, 6.0))
    assert compared(candidate("best", 40.0, None), near, far) == ["best", near.name]


def test_six_at_most_are_compared():
    crowd = [candidate(f"effect{i}", 40.0 - 0.1 * i, None) for i in range(9)]
    assert compared(*crowd) == [f"effect{i}" for i in range(6)]


def test_the_best_with_a_name_is_always_compared():
    """However far behind forms it is."""
    forms = [candidate(name, 90.0 - i, None) for i, name in enumerate((FORM, OTHER_FORM))]
    named, next_named = candidate("air_drag", 10.0, None), candidate("rolling", 9.9, None)
    assert compared(*forms, named, next_named) == [FORM, OTHER_FORM, "air_drag"]


def test_rivals_are_each_others():
    three = [
        candidate("air_drag", 40.0),
        candidate("rolling", 37.0 + EDGE),
        candidate("stribeck", 37.0),
        candidate("restitution", 39.0, None),
    ]
    found = {c.name: rivals(c, three) for c in three}
    assert found == {
        "air_drag": ("rolling",),
        "rolling": ("air_drag", "stribeck"),
        "stribeck": ("rolling",),
        "restitution": (),
    }
    for name, others in found.items():
        assert all(name in found[other] for other in others)


# What is added.


def test_what_is_named_is_added():
    singles = (candidate("rolling", 40.0), candidate("air_drag", 39.0))
    assert to_add(Verdict("named", ("air_drag",)), singles) is singles[1]
    assert to_add(Verdict("ambiguous", ("air_drag", "rolling")), singles) is singles[1]


def test_a_pair_that_is_named_is_added_whole():
    pairs = (candidate(PAIR, 60.0), candidate("air_drag", 40.0), candidate("rolling", 20.0))
    assert to_add(Verdict("named", ("air_drag", "rolling")), pairs) is pairs[0]
    assert to_add(Verdict("ambiguous", (PAIR, "air_drag+stribeck")), pairs) is pairs[0]


def test_of_the_unknown_the_best_name_is_shown_if_it_helps():
    form, helps = candidate(FORM, 60.0), candidate("air_drag", 10.0 + EDGE)
    assert to_add(Verdict("unknown", (), FORM), (form, helps)) is helps
    assert to_add(Verdict("unknown", ()), (form, replace(helps, log_evidence=10.0))) is None


# Probabilities.


def test_nothing_missing_has_half_of_the_prior():
    """As good as no effect: the candidates share the other half."""
    np.testing.assert_allclose(probabilities(np.zeros(4)), 0.125)


def test_probabilities_follow_the_evidence():
    first, second = probabilities(np.log([8.0, 2.0]))
    assert first == pytest.approx(8 / 12) and second == pytest.approx(2 / 12)
    assert probabilities(np.array([5000.0, 0.0])) == pytest.approx([1.0, 0.0])
