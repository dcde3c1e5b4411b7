"""The rules of the verdict, on candidates made by hand: each threshold, at and just beside it.

Thresholds stand here as plain numbers, not imported: whoever changes one changes a promise.
"""

from dataclasses import replace
from typing import Any, cast

import numpy as np
import pytest

from galileo_jax.comparison.compare import Comparison
from galileo_jax.diagnosis.candidates import incredible
from galileo_jax.diagnosis.diagnosis import Candidate, Diagnosis, Verdict
from galileo_jax.diagnosis.stakes import (
    VerdictStakes,
    decisive_margin,
    log_prior,
    num_expected,
    without_surplus,
)
from galileo_jax.diagnosis.verdict import (
    best_named,
    explains,
    form_that_leads,
    is_nothing_missing,
    looked_at_again,
    needs_pairs,
    pair_ahead_of_all,
    ranked,
    rivals,
    to_add,
    to_compare,
    verdict_of,
    within_luck,
    without_a_name,
)
from galileo_jax.inference.fits.gradient import Code, GradientFit
from galileo_jax.inference.joint_problem import JointProblem
from galileo_jax.model.effects import Normal, Parameter
from galileo_jax.model.effects.forms import FORM_NAMES
from galileo_jax.search.hypothesis import Hypothesis

FORM, OTHER_FORM = FORM_NAMES[:2]
EDGE = 1e-6  # just beside a threshold
DECISIVE = 3.0
PAIR = "air_drag+rolling"


def candidate(
    name: str, log_odds: float, p_value: float | None = 0.5, log_prior: float = -2.0
) -> Candidate:
    """One hypothesis; `name` may be several, joined by +."""
    effects = tuple(name.split("+"))
    none = np.zeros(0)
    fit = GradientFit(
        z=none,
        free=np.zeros(0, bool),
        covariance=np.zeros((0, 0)),
        chi2=1000.0,
        log_evidence=log_odds - log_prior,
        num_values=1000,
        steps=none,
        jacobian=np.zeros((1000, 0)),
        code=Code.CONVERGED,
        stats={},
        pull=0.0,
        num_pulled=0.0,
    )
    hypothesis = Hypothesis(effects, fit)
    evidence = fit.log_evidence
    return Candidate(effects, hypothesis, {}, 5.0, evidence, log_prior, 0.5, p_value, ())


def verdict(*candidates: Candidate, decisive: float = DECISIVE) -> Verdict:
    """Of candidates in any order."""
    return verdict_of(ranked(candidates), decisive)


def told(found: Verdict) -> tuple[str, tuple[str, ...], str | None]:
    """What it says, without why."""
    return found.status, found.effects, found.form


def rules(found: Verdict) -> list[str]:
    return [why.rule for why in found.reasons]


UNKNOWN = ("unknown", (), None)


class _Trials:
    """What is asked of trials: their parameters."""

    parameters = (
        Parameter("k1", "1", Normal(0.0, 1.0), 0.0, "main", 0.1),
        Parameter("table_tilt", "rad", Normal(0.0, 0.026), 0.0, "effect", 0.1),
    )


@pytest.mark.parametrize("z, is_believed", [(6 - EDGE, True), (6 + EDGE, False), (-7.0, False)])
def test_what_nobody_would_believe_explains_nothing(z, is_believed):
    one = candidate("table_tilt", 500.0)
    fit = replace(one.hypothesis.fit, z=np.array([9.0, z]), free=np.ones(2, bool))
    far = incredible(cast(JointProblem, _Trials()), replace(one.hypothesis, fit=fit))
    assert far == (() if is_believed else ("table_tilt",))
    assert explains(replace(one, unusual=far)) == is_believed


# The table of all hypotheses.


def test_probabilities_of_the_whole_table_sum_to_1():
    table = ranked([candidate("air_drag", 2.0), candidate(PAIR, 3.0), candidate(FORM, -1.0)])
    assert [c.name for c in table] == [PAIR, "air_drag", FORM]
    weights = np.exp([3.0, 2.0, -1.0, 0.0])  # none last
    expected = weights / weights.sum()
    np.testing.assert_allclose([c.probability for c in table], expected[:3])
    assert found_none(table) == pytest.approx(expected[3])


def test_they_do_so_however_far_apart_they_are():
    table = ranked([candidate("air_drag", 5000.0), candidate("rolling", -5000.0)])
    assert [c.probability for c in table] == pytest.approx([1.0, 0.0])
    assert found_none(table) == 0.0


def found_none(table: tuple[Candidate, ...]) -> float:
    return Diagnosis((), table, Verdict("none", ())).probability_none


def test_single_effects_together_are_as_probable_as_none():
    assert 17 * np.exp(log_prior([1.0], 17)) == pytest.approx(1.0)


def test_pairs_together_are_a_tenth_as_probable():
    assert 17 * 16 / 2 * np.exp(log_prior([1.0, 1.0], 17)) == pytest.approx(0.1)


@pytest.mark.parametrize("odds", [30.0, 0.05])
def test_what_a_clip_leads_to_expect_counts(odds):
    for others in ([], [1.0]):
        by = log_prior([odds, *others], 17) - log_prior([1.0, *others], 17)
        assert by == pytest.approx(np.log(odds))


def test_what_ranks_is_evidence_and_prior_together():
    assert candidate("air_drag", 40.0, log_prior=-7.0).log_odds == pytest.approx(40.0)
    rarer = candidate(PAIR, 41.0, log_prior=-9.0)
    assert rarer.log_evidence == pytest.approx(50.0)
    assert [c.name for c in ranked([rarer, candidate("air_drag", 42.0)])] == ["air_drag", PAIR]


# Named and ambiguous.


def test_the_only_one_that_explains_is_named():
    found = verdict(candidate("air_drag", 40.0), candidate("rolling", 39.0, p_value=1e-9))
    assert told(found) == ("named", ("air_drag",), None)
    assert rules(found) == ["explains", "no_rival"]


@pytest.mark.parametrize(
    ("behind", "p_values", "also"),
    [
        ((3.5, 3.6, 9.0), (0.5, 0.5, 0.5), ("rolling",)),  # 0.030 + 0.027 > 0.050
        ((3.1, 3.6, 3.6), (0.5, 0.5, 0.5), ("rolling", "restitution")),
        ((3.5, 3.6, 9.0), (0.5, None, 0.5), ("rolling",)),  # it was not compared
        ((3.8, 3.8, 9.0), (0.5, 0.5, 0.5), ()),  # 0.022 + 0.022 < 0.050
        ((3.5, 3.6, 9.0), (0.5, 1e-9, 0.5), ()),  # contradicted
    ],
)
def test_rivals_that_are_given_up_one_by_one_are_not_all_together(behind, p_values, also):
    names = ("rolling", "restitution", "stribeck")
    others = [
        candidate(name, 40.0 - by, p) for name, by, p in zip(names, behind, p_values, strict=True)
    ]
    found = verdict(candidate("air_drag", 40.0), *others)
    expected = ("ambiguous", ("air_drag", *also)) if also else ("named", ("air_drag",))
    assert told(found) == (*expected, None)
    if also:
        assert rules(found) == ["explains", "contested_together"]
        share = -np.log(np.sum(np.exp(-np.array(behind))))
        assert found.reasons[-1].numbers["log_odds_behind"] == pytest.approx(share)


@pytest.mark.parametrize(
    ("lead", "p_value", "is_told"),
    [
        (0.0, 0.5, False),
        (1.1512925 - EDGE, 0.5, False),  # ln 10 / 2
        (1.1512925 + EDGE, 0.5, True),
        (0.0, 1e-9, True),  # contradicted
        (0.0, None, True),  # not compared: `to_compare` would have had it compared
    ],
)
@pytest.mark.parametrize("other", [FORM, "restitution+rolling"])
def test_what_was_believed_beforehand_makes_no_name(lead, p_value, is_told, other):
    """A rival four nats behind that had at least three of these before the data."""
    best, behind = candidate("viscous_drag", 40.0), 4.0
    rival = candidate(other, 40.0 - behind, p_value, log_prior=-2.0 - behind + lead)
    assert best.log_evidence - rival.log_evidence == pytest.approx(lead)
    found = verdict(best, rival)
    if is_told:
        assert told(found) == ("named", ("viscous_drag",), None)
        return
    assert told(found) == ("ambiguous", ("viscous_drag", other), None)
    assert rules(found) == ["explains", "separated_by_prior"]
    numbers = found.reasons[-1].numbers
    assert numbers["log_evidence_behind"] == pytest.approx(lead)
    assert numbers["log_prior_behind"] == pytest.approx(behind - lead)


def test_what_is_expected_or_only_adds_to_a_name_needs_no_proof_by_data():
    same, much_rarer = candidate(FORM, 36.0, log_prior=-6.0), -9.0
    expected = replace(candidate("air_drag", 40.0), num_expected=1)
    assert told(verdict(expected, same)) == ("named", ("air_drag",), None)
    more = candidate(PAIR, 33.0, log_prior=much_rarer)
    assert told(verdict(candidate("air_drag", 40.0), more)) == ("named", ("air_drag",), None)


def test_what_the_data_hardly_tell_from_the_best_is_compared():
    same = candidate("restitution+rolling", 34.0, log_prior=-8.0)
    less = candidate("stribeck", 36.0, log_prior=-4.0)
    table = ranked([candidate("air_drag", 40.0), same, less])
    assert [c.name for c in to_compare(table, DECISIVE)] == ["air_drag", "restitution+rolling"]


def test_pairs_with_what_is_named_do_not_contest_it_together():
    others = [f"air_drag+{name}" for name in ("rolling", "restitution", "stribeck")]
    found = verdict(candidate("air_drag", 40.0), *(candidate(pair, 36.5) for pair in others))
    assert told(found) == ("named", ("air_drag",), None)


def test_all_that_may_contest_together_are_compared():
    odds = {"air_drag": 40.0, "air_drag+rolling": 36.6}
    odds |= {"rolling": 36.5, "restitution": 36.4, "stribeck": 36.4}
    table = ranked([candidate(name, nats) for name, nats in odds.items()])
    names = [c.name for c in to_compare(table, DECISIVE)]
    assert names == ["air_drag", "rolling", "restitution"]


def test_a_more_probable_one_that_is_contradicted_is_said_to_be_out_of_the_race():
    better, best = candidate("rolling", 41.0, p_value=0.0099), candidate("air_drag", 40.0)
    found = verdict(better, best, candidate("stribeck", 30.0))
    assert told(found) == ("named", ("air_drag",), None)
    assert rules(found) == ["explains", "out_of_the_race", "decisive"]
    assert found.reasons[1].numbers["rival"] == "rolling"
    assert found.reasons[1].numbers["least_p_value"] == 0.01
    assert found.reasons[2].numbers["log_odds_behind"] == pytest.approx(10.0)
    assert "2.7 times as probable as air_drag" in found.reasons[1].sentence


def test_one_that_was_not_compared_is_no_rival():
    found = verdict(candidate("air_drag", 40.0), candidate("rolling", 39.0, None))
    assert told(found) == ("named", ("air_drag",), None)


def test_an_effect_without_any_other_is_named():
    assert rules(verdict(candidate("air_drag", 40.0))) == ["explains", "no_rival"]


@pytest.mark.parametrize("rival", ["rolling", "rolling+restitution"])
@pytest.mark.parametrize(
    ("behind", "status", "why"),
    [
        (3.0 - EDGE, "ambiguous", "contested"),
        (3.0, "named", "decisive"),
        (3.0 + EDGE, "named", "decisive"),
    ],
)
def test_of_two_that_explain_one_is_named_if_the_other_is_decisively_behind(
    behind, status, why, rival
):
    found = verdict(
        candidate("air_drag", 40.0),
        candidate(rival, 40.0 - behind),
        decisive=decisive_margin(False),
    )
    assert told(found)[:2] == (status, ("air_drag", rival)[: 1 + (status == "ambiguous")])
    assert rules(found) == ["explains", why]
    assert found.reasons[1].numbers["log_odds_behind"] == pytest.approx(behind)


@pytest.mark.parametrize(("behind", "status"), [(6.0 - EDGE, "ambiguous"), (6.0, "named")])
def test_the_margin_is_twice_as_wide_where_the_base_is_adequate(behind, status):
    found = verdict(
        candidate("air_drag", 40.0),
        candidate("rolling", 40.0 - behind),
        decisive=decisive_margin(True),
    )
    assert found.status == status


def test_a_pair_far_better_than_a_single_effect_that_explains_is_named():
    found = verdict(candidate("air_drag", 40.0, 0.02), candidate(PAIR, 43.0))
    assert told(found) == ("named", ("air_drag", "rolling"), None)


@pytest.mark.parametrize("better", ["rolling", PAIR, FORM])
def test_a_better_one_that_does_not_explain_rules_out_the_one_that_does(better):
    def found(ahead):
        return verdict(candidate("air_drag", 40.0), candidate(better, 40.0 + ahead, p_value=1e-9))

    assert told(found(3.0 - EDGE)) == ("named", ("air_drag",), None)
    assert told(found(3.0)) == UNKNOWN
    assert rules(found(3.0)) == ["better_but_contradicted"]


def test_less_probable_than_no_effect_is_no_verdict():
    assert told(verdict(candidate("air_drag", 0.0))) == ("named", ("air_drag",), None)
    luck = verdict(candidate("air_drag", -EDGE))
    assert told(luck) == UNKNOWN and rules(luck) == ["less_probable_than_none"]


# What explains the data.


@pytest.mark.parametrize(("beside", "is_explained"), [(0.0, True), (-EDGE, False)])
@pytest.mark.parametrize(("name", "least"), [("air_drag", 0.01), (PAIR, 0.05), (FORM, 0.01)])
def test_the_least_p_value_that_explains(name, least, beside, is_explained):
    """A name that leaves more than noise is no name for it; two must leave less than one."""
    one = candidate(name, 40.0, least + beside)
    assert explains(one) is is_explained
    assert (rules(verdict(one)) == ["nothing_explains"]) is not is_explained


@pytest.mark.parametrize(
    ("p_value", "beside", "names"),
    [
        (0.011, "air_drag+frame_rate", ("air_drag+frame_rate", PAIR)),
        (0.01 - EDGE, "air_drag+frame_rate", tuple(PAIR.split("+"))),
        (None, "air_drag+frame_rate", tuple(PAIR.split("+"))),
    ],
)
def test_a_pair_is_not_passed_over_for_a_less_probable_one(p_value, beside, names):
    """Both leave about as much; at 0.05 one of twenty true pairs would be passed over."""
    found = verdict(candidate(beside, 41.0, p_value), candidate(PAIR, 40.0, 0.052))
    assert told(found)[1] == names


def test_a_pair_is_passed_over_for_a_single_effect_that_explains():
    found = verdict(candidate("rolling+air_drag", 41.0, 0.02), candidate("stribeck", 40.0))
    assert told(found) == ("named", ("stribeck",), None)


def test_what_was_not_compared_explains_nothing():
    assert not explains(candidate("air_drag", 40.0, None))


# Forms without a name, and unknown.


def test_only_a_form_explains():
    wrong = candidate("air_drag", 60.0, p_value=1e-9)
    found = verdict(candidate(FORM, 59.0), wrong)
    assert told(found) == ("unknown", (), FORM) and rules(found) == ["only_a_form"]


def test_nothing_explains():
    wrong = candidate("air_drag", 60.0, p_value=1e-9)
    assert told(verdict(wrong, candidate(FORM, 59.0, p_value=1e-3))) == UNKNOWN
    found = verdict(wrong)
    assert told(found) == UNKNOWN
    assert found.reasons[0].numbers["p_value"] == 1e-9


@pytest.mark.parametrize("name", ["air_drag", "air_drag+rolling"])
@pytest.mark.parametrize(
    ("ahead", "status"),
    [
        (3.0, "unknown"),
        (3.0 - EDGE, "ambiguous"),
        (-3.0 + EDGE, "ambiguous"),
        (-3.0, "named"),
    ],
)
def test_a_form_against_a_name(name, ahead, status):
    found = verdict(candidate(name, 40.0), candidate(FORM, 40.0 + ahead))
    effects = {"unknown": (), "ambiguous": (name, FORM), "named": tuple(name.split("+"))}
    assert told(found) == (status, effects[status], FORM if status == "unknown" else None)


def test_one_form_stands_last_in_an_ambiguous_verdict():
    """Also where it is the best, and however many there are."""
    found = verdict(
        candidate(FORM, 42.0),
        candidate("air_drag", 41.0),
        candidate("rolling", 40.0),
        candidate(OTHER_FORM, 39.5),
    )
    assert told(found) == ("ambiguous", ("air_drag", "rolling", FORM), None)
    assert [why.numbers.get("rival") for why in found.reasons] == [None, "rolling", FORM]


def test_an_effect_is_not_repeated_with_others_that_add_nothing():
    found = verdict(
        candidate(FORM, 42.0),
        candidate("viscous_drag", 41.5),
        candidate("viscous_drag+rolling", 41.0),
        candidate("air_drag+rolling", 40.5),
        candidate("air_drag", 40.0),
    )
    assert told(found) == (
        "ambiguous",
        ("viscous_drag", "air_drag+rolling", "air_drag", FORM),
        None,
    )


def test_an_effect_with_another_that_the_data_favour_contests_it():
    """Only what is believed before the data speaks for the effect alone: that is no claim."""
    alone = candidate("air_drag", 41.0)
    for evidence_ahead, names in ((EDGE, ("air_drag", PAIR)), (-EDGE, ("air_drag", "rolling"))):
        joined = candidate(PAIR, 40.0, log_prior=-3.0 - evidence_ahead)
        found = verdict(alone, joined, candidate("rolling", 39.0, log_prior=3.0))
        assert told(found)[1][:2] == names


def test_one_effect_or_it_and_another_is_ambiguous():
    found = verdict(candidate("air_drag", 42.0), candidate("air_drag+rolling", 40.0))
    assert told(found) == ("ambiguous", ("air_drag", "air_drag+rolling"), None)


# None.


@pytest.mark.parametrize(
    ("is_accepted", "log_odds", "is_none"),
    [(True, 7.0 - EDGE, True), (True, 7.0, False), (False, -5.0, False)],
)
def test_nothing_is_missing_where_the_base_will_do_and_nothing_convinces(
    is_accepted, log_odds, is_none
):
    candidates = (candidate("air_drag", log_odds, None), candidate("rolling", -9.0, None))
    assert is_nothing_missing(is_accepted, candidates) is is_none


def test_a_form_alone_does_not_convince():
    candidates = (candidate(FORM, 30.0, None), candidate("air_drag", 6.0, None))
    assert best_named(candidates).name == "air_drag"
    assert is_nothing_missing(True, candidates)


# Pairs.

LIBRARY = ["air_drag", "rolling", "stribeck"]


@pytest.mark.parametrize(
    ("singles", "is_needed"),
    [
        ([("air_drag", 40.0, 0.01)], False),
        ([("air_drag", 40.0, 0.01 - EDGE)], True),
        ([("air_drag", 40.0, 0.5), (FORM, 40.0 - EDGE, 0.5)], False),
        ([("air_drag", 40.0, 0.5), (FORM, 40.0 + EDGE, 0.5)], True),
        ([("air_drag", 40.0, 0.5), (FORM, 50.0, 0.01 - EDGE)], False),
        ([("air_drag", 40.0, 0.001), ("rolling", 39.0, 0.5)], True),
    ],
)
def test_pairs_are_tried_where_the_best_single_effect_is_not_enough(singles, is_needed):
    table = ranked([candidate(*one) for one in singles])
    assert needs_pairs(table) is is_needed


def test_the_form_that_leads_is_the_best_that_explains():
    wrong, right = candidate(FORM, 50.0, 1e-3), candidate(OTHER_FORM, 45.0)
    assert form_that_leads([wrong, right, candidate("air_drag", 40.0)]) is right


def compared(*candidates: Candidate, margin: float = DECISIVE) -> list[str]:
    return [c.name for c in to_compare(candidates, margin)]


@pytest.mark.parametrize("margin", [3.0, 6.0])
def test_what_is_near_the_best_is_compared(margin):
    near, far = (candidate(f"at{b}", 40.0 - b, None) for b in (margin - EDGE, margin))
    assert compared(candidate("best", 40.0, None), near, far, margin=margin) == ["best", near.name]


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


# What could be confused with what is named.

NAMED = candidate("air_drag", 40.0)


@pytest.mark.parametrize("decisive", [3.0, 6.0])
def test_a_rival_is_looked_at_unless_it_is_too_far_behind_for_luck(decisive):
    farthest = decisive + 4 * np.sqrt(2 * decisive)
    near, far = (candidate(f"at{b}", 40.0 - b, None) for b in (farthest - EDGE, farthest))
    assert within_luck(NAMED, [NAMED, near, far], decisive) == [near]


def test_what_the_data_contradict_is_not_looked_at():
    wrong = candidate("rolling", 39.0, 0.01 - EDGE)
    form = candidate(FORM, 30.0, 0.01)
    assert within_luck(NAMED, [NAMED, wrong, form], DECISIVE) == [form]


def test_what_a_clip_like_this_one_would_not_tell_apart_is_not_named():
    plain = verdict(NAMED, candidate("rolling", 30.0, None))
    by = {"rolling": 3.0, "stribeck": 3.0 - EDGE, FORM: 1.0, OTHER_FORM: 2.0}
    looked = [(candidate(name, 30.0, None), expected) for name, expected in by.items()]
    clear = looked_at_again(plain, NAMED, looked[:1], DECISIVE)
    assert told(clear) == told(plain) == ("named", ("air_drag",), None)
    assert rules(clear) == [*rules(plain), "told_apart"]
    found = looked_at_again(plain, NAMED, looked, DECISIVE)
    assert told(found) == ("ambiguous", ("air_drag", "stribeck", FORM), None)
    assert rules(found)[2:] == ["told_apart", *3 * ["not_told_apart"]]
    assert found.reasons[3].numbers["log_odds_expected"] == pytest.approx(3.0 - EDGE)


def test_a_pair_that_is_not_told_apart_is_named_whole():
    pair, rival = candidate(PAIR, 40.0), candidate("rolling+stribeck", 30.0, None)
    found = looked_at_again(verdict(pair, rival), pair, [(rival, 0.0)], DECISIVE)
    assert found.effects == (PAIR, "rolling+stribeck")


# What is added.


def test_what_is_named_is_added():
    singles = (candidate("rolling", 40.0), candidate("air_drag", 39.0))
    assert to_add(Verdict("named", ("air_drag",)), singles) is singles[1]
    assert to_add(Verdict("ambiguous", ("air_drag", "rolling")), singles) is singles[1]


def test_a_pair_that_is_named_is_added_whole():
    pairs = (candidate(PAIR, 60.0), candidate("air_drag", 40.0), candidate("rolling", 20.0))
    assert to_add(Verdict("named", ("air_drag", "rolling")), pairs) is pairs[0]
    assert to_add(Verdict("ambiguous", (PAIR, "air_drag+stribeck")), pairs) is pairs[0]


def test_a_pair_is_added_though_one_of_its_effects_that_is_contradicted_ranks_before_it():
    table = ranked([candidate("air_drag", 61.0, p_value=0.001), candidate(PAIR, 60.0)])
    named = verdict_of(table, DECISIVE)
    assert told(named) == ("named", ("air_drag", "rolling"), None)
    assert to_add(named, table) is table[1]


def test_of_the_unknown_the_best_name_is_shown_if_it_helps():
    form, helps = candidate(FORM, 60.0), candidate("air_drag", 8.0 + EDGE, log_prior=-2.0)
    assert to_add(Verdict("unknown", (), FORM), (form, helps)) is helps
    assert to_add(Verdict("unknown", ()), (form, replace(helps, log_evidence=10.0))) is None


def may_decide(is_adequate: bool, *columns: np.ndarray) -> list[bool]:
    nothing: Any = None  # of trials is asked
    return VerdictStakes(nothing, is_adequate).may_decide(*columns).tolist()


@pytest.mark.parametrize(
    ("log_odds", "is_adequate", "expected"),
    [
        # 3 + 4 sqrt(6) = 12.8 nats that luck can make, and 5 that another valley may bring.
        ([50.0, 33.0, 31.0], False, [True, True, False]),
        # The margin is twice as wide: 6 + 4 sqrt(12) = 19.9.
        ([50.0, 26.0, 24.0], True, [True, True, False]),
        # The best may still come to convince, at 7 nats.
        ([2.5, -10.0], True, [True, True]),
        ([1.5, -10.0], True, [False, False]),
        ([1.5, -10.0], False, [True, True]),
    ],
)
def test_on_whom_the_verdict_may_hang(log_odds, is_adequate, expected):
    is_form, alone = np.zeros(len(log_odds), bool), np.ones(len(log_odds), int)
    assert may_decide(is_adequate, np.array(log_odds), is_form, alone) == expected


def test_a_form_alone_convinces_nobody():
    is_form, alone = np.array([True, False]), np.array([1, 1])
    assert not any(may_decide(True, np.array([30.0, 0.0]), is_form, alone))


def test_what_has_an_effect_more_than_the_leader_is_not_behind_by_bad_luck():
    """Eight nats: the margin of three, and five that another valley may bring."""
    log_odds, num_effects = np.array([50.0, 43.0, 41.0, 41.0]), np.array([1, 2, 2, 1])
    found = may_decide(False, log_odds, np.zeros(4, bool), num_effects)
    assert found == [True, True, False, True]


def test_a_pair_that_cannot_contest_the_leading_effect_is_left_out():
    single, near, far = (
        candidate(name, odds)
        for name, odds in (("air_drag", 40.0), (PAIR, 36.1), ("air_drag+stribeck", 35.9))
    )
    assert without_surplus([single, near, far]) == [single, near]
    ahead = candidate(PAIR, 41.0)
    assert without_surplus([single, ahead, far]) == [single, ahead, far]
    assert without_surplus([]) == []


def test_a_pair_with_what_is_expected_counts_as_one_effect():
    """The air's drag on a ball surprises nobody: p = 0.03 is enough for it and one effect more."""
    pair = candidate(PAIR, 50.0, p_value=0.03)
    assert not explains(pair)
    assert explains(replace(pair, num_expected=1))
    assert not explains(replace(candidate(PAIR, 50.0, p_value=0.009), num_expected=1))
    assert [num_expected(odds) for odds in ([1.0, 30.0], [1.0, 2.0], [30.0, 5.0])] == [1, 0, 2]


def test_a_pair_ahead_of_all_that_was_tried_needs_no_more_than_one_effect():
    others = candidate("air_drag", 9.0), candidate("law_push_power_t", 36.9, 1e-6)
    table = ranked([candidate("air_drag+stribeck", 40.0, 0.03), *others])
    ahead = pair_ahead_of_all(table, DECISIVE)
    assert ahead is not None and ahead.name == "air_drag+stribeck"
    assert verdict_of(table, DECISIVE).status == "unknown"  # before formulas were tried


@pytest.mark.parametrize(
    ("p_value", "rival"),
    [
        (0.009, candidate("rolling", 9.0)),  # contradicted
        (0.2, candidate("rolling", 9.0)),  # the usual rules name it
        (0.03, candidate("rolling", 38.0, 1e-6)),  # nearly as probable, contradicted or not
        (0.03, candidate("force_at_a_time", 38.0)),
    ],
)
def test_a_pair_not_ahead_of_all_or_contradicted_is_not_named(p_value, rival):
    table = ranked([candidate("air_drag+stribeck", 40.0, p_value), rival])
    assert pair_ahead_of_all(table, DECISIVE) is None


def test_a_single_effect_is_no_pair():
    table = ranked([candidate("air_drag", 40.0, 0.03), candidate("rolling", 9.0)])
    assert pair_ahead_of_all(table, DECISIVE) is None


@pytest.mark.parametrize(
    ("p_value", "unusual", "best", "status", "effects"),
    [
        (0.01, (), 3 - EDGE, "none", ()),
        (0.01 - EDGE, (), 0.0, None, ()),
        (0.5, (), 3 + EDGE, None, ()),
        (0.5, ("friction_roughness",), -3 - EDGE, "named", ("uneven_friction",)),
        (0.5, ("friction_roughness",), -3 + EDGE, "ambiguous", ("air_drag", "uneven_friction")),
        (0.5, ("friction_roughness",), 3 - EDGE, "ambiguous", ("air_drag", "uneven_friction")),
        (0.5, ("friction_roughness",), 3 + EDGE, None, ()),
        (0.5, ("gusts",), 0.0, None, ()),
        (0.5, ("friction_roughness", "lasting_error"), 0.0, None, ()),
    ],
)
def test_imperfections_explain_where_no_effect_beside_them_is_ahead(
    p_value, unusual, best, status, effects
):
    """Of usual sizes: none; friction alone larger than usual: it has the name of an effect."""
    found = Comparison(p_value, (), (), {}, (), (), (1.0,), False, unusual)
    verdict = without_a_name(found, [candidate("air_drag", best)])
    assert (None if verdict is None else verdict.status) == status
    if verdict is not None:
        assert verdict.effects == effects
        added = to_add(verdict, [candidate("air_drag", best)])
        assert (None if added is None else added.name) == (
            "air_drag" if status == "ambiguous" else None
        )


@pytest.mark.parametrize(("best", "status"), [(7 - EDGE, "none"), (7 + EDGE, None)])
def test_a_form_beside_usual_imperfections_has_to_convince(best, status):
    """It stands for anything smooth, and so do they."""
    found = Comparison(0.5, (), (), {}, (), (), (1.0,), False)
    verdict = without_a_name(found, [candidate(FORM, best)])
    assert (None if verdict is None else verdict.status) == status


@pytest.mark.parametrize(("best", "rules"), [(3 - EDGE, 1), (3 + EDGE, 2)])
def test_a_form_that_leads_beside_imperfections_is_told_of(best, rules):
    """The table has it first, and 'no effect is 20 times as probable' stands below."""
    found = Comparison(0.5, (), (), {}, (), (), (1.0,), False)
    verdict = without_a_name(found, [candidate(FORM, best)])
    assert verdict is not None
    assert [one.rule for one in verdict.reasons] == ["imperfections_explain", "form_beside"][:rules]


def test_friction_that_would_push_is_no_uneven_friction():
    found = Comparison(0.5, (), (), {}, (), (), (1.0,), False, ("friction_roughness",))
    assert without_a_name(found, [candidate("air_drag", -9.0)], is_friction=False) is None


def test_a_candidate_with_unusual_imperfections_explains_nothing():
    """Whatever its p-value is."""
    assert explains(candidate("air_drag", 9.0))
    assert not explains(replace(candidate("air_drag", 9.0), unusual=("gusts",)))
