"""When a formula is a law: each threshold, at and just beside it, on candidates made by hand."""

from dataclasses import replace

import pytest

from galileo_jax.diagnosis.diagnosis import Candidate, Law, Verdict
from galileo_jax.diagnosis.law_verdict import (
    best_formula,
    contested_by_law,
    is_law_needed,
    law_contested,
    law_odds,
    law_to_doubt,
    law_verdict,
    needs_laws,
    other_formulas,
)
from galileo_jax.diagnosis.verdict import best_named, looked_at_again, ranked, to_compare
from tests.diagnosis.test_verdict import DECISIVE, EDGE, candidate

FORM_OF_POWER_V, FORM_OF_PULSE_T = "drag_of_a_power", "force_at_a_time"


def law(
    log_odds: float, p_value: float | None = 0.5, family: str = "power_v", name: str = "law_1"
) -> Candidate:
    made = candidate(name, log_odds, p_value)
    return replace(made, law=Law(f"a = 1 {family}", family, "", {}))


def status(*candidates: Candidate) -> str | None:
    found = law_verdict(ranked(candidates), DECISIVE)
    return None if found is None else found.status


def test_a_formula_that_leaves_nothing_and_beats_all_others_is_a_law():
    best = law(50.0)
    found = law_verdict(ranked([best, candidate("air_drag", 20.0, 1e-6)]), DECISIVE)
    assert found is not None
    assert (found.status, found.effects, found.law) == ("law", ("law_1",), best.law)
    assert [why.rule for why in found.reasons] == ["explains", "decisive"]


@pytest.mark.parametrize(("p_value", "expected"), [(0.01, "law"), (0.01 - EDGE, None)])
def test_what_leaves_more_than_noise_is_no_law(p_value, expected):
    assert status(law(50.0, p_value), candidate("air_drag", 20.0, 1e-6)) == expected


@pytest.mark.parametrize(("behind", "expected"), [(DECISIVE, "law"), (DECISIVE - EDGE, None)])
@pytest.mark.parametrize("name", ["air_drag", "air_drag+rolling", FORM_OF_PULSE_T])
def test_another_explanation_must_be_far_behind(name, behind, expected):
    assert status(law(50.0), candidate(name, 50.0 - behind)) == expected


@pytest.mark.parametrize(("behind", "expected"), [(DECISIVE, "law"), (DECISIVE - EDGE, None)])
def test_another_formula_must_be_far_behind(behind, expected):
    other = law(50.0 - behind, family="power_t", name="law_2")
    assert status(law(50.0), other) == expected


def test_the_same_formula_in_another_way_is_no_rival():
    assert status(law(50.0), law(49.9, name="law_2"), candidate(FORM_OF_POWER_V, 52.0)) == "law"


@pytest.mark.parametrize(("ahead", "expected"), [(DECISIVE, None), (DECISIVE - EDGE, "law")])
def test_behind_what_the_data_contradict_it_is_not_the_truth(ahead, expected):
    assert status(law(50.0), candidate("air_drag", 50.0 + ahead, 1e-6)) == expected


def test_without_formulas_there_is_no_law():
    assert status(candidate(FORM_OF_POWER_V, 50.0), candidate("air_drag", 10.0)) is None


def test_a_formula_less_probable_than_none_is_no_law():
    assert status(law(-EDGE), candidate("air_drag", -20.0)) is None


def test_a_library_effect_is_named_before_any_law():
    assert best_named(ranked([law(50.0), candidate("air_drag", 10.0)])).name == "air_drag"


def test_reasons_say_why_there_is_no_law():
    contested = ranked([law(50.0), law(48.0, family="power_t", name="law_2")])
    assert [why.rule for why in law_contested(contested, DECISIVE)] == ["contested"]
    contradicted = ranked([law(50.0, 1e-5)])
    assert [why.rule for why in law_contested(contradicted, DECISIVE)] == ["no_law_explains"]
    far_ahead = ranked([law(50.0), candidate("friction_patch", 50.0 + 2 * DECISIVE)])
    assert [why.rule for why in law_contested(far_ahead, DECISIVE)] == ["less_probable"]
    ahead_but_wrong = ranked([law(50.0), candidate("friction_patch", 60.0, 1e-5)])
    assert [why.rule for why in law_contested(ahead_but_wrong, DECISIVE)] == [
        "better_but_contradicted"
    ]
    names = ("friction_patch", "magnetic_brake", "stribeck")
    many = ranked([law(50.0), *(candidate(name, 46.5) for name in names)])
    assert law_verdict(many, DECISIVE) is None
    assert [why.rule for why in law_contested(many, DECISIVE)] == ["contested_together"]
    none = ranked([candidate("air_drag", 10.0)])
    assert [why.rule for why in law_contested(none, DECISIVE)] == ["no_formula"]


def test_the_best_formula_is_compared_however_far_behind():
    forms = [candidate(FORM_OF_PULSE_T, 90.0), candidate("air_drag", 80.0)]
    laws = [law(20.0, None), law(19.9, None, name="law_2")]
    assert [c.name for c in to_compare([*forms, *laws], DECISIVE)] == [
        FORM_OF_PULSE_T,
        "air_drag",
        "law_1",
    ]


def test_the_best_formula_explains_the_data_if_any_does():
    first, second = law(50.0, 1e-4), law(45.0, 0.3, name="law_2")
    named = candidate("air_drag", 60.0)
    assert best_formula([named, first, second]) is second
    assert best_formula([named, first, replace(second, p_value=1e-6)]) is first
    assert best_formula([named]) is None


@pytest.mark.parametrize(("expected", "said"), [(DECISIVE, "law"), (DECISIVE - EDGE, "ambiguous")])
def test_luck_does_not_make_a_law(expected, said):
    best, rival = law(50.0), candidate("air_drag", 40.0)
    found = law_verdict(ranked([best, rival]), DECISIVE)
    assert found is not None
    assert looked_at_again(found, best, [(rival, expected)], DECISIVE).status == said


def test_rivals_are_of_another_formula():
    best, same = law(50.0), law(49.0, name="law_2")
    other = candidate(FORM_OF_PULSE_T, 45.0)
    form = candidate(FORM_OF_POWER_V, 44.0)
    assert other_formulas(best, [best, same, other, form]) == (best, other)


@pytest.mark.parametrize(
    ("effects", "ahead", "expected"),
    [
        (("air_drag", "rolling"), DECISIVE, "named"),
        (("air_drag", "rolling"), DECISIVE - EDGE, "unknown"),
        (("friction_patch",), DECISIVE, "named"),
        (("friction_patch",), DECISIVE - EDGE, "ambiguous"),
        (("friction_patch",), EDGE - DECISIVE, "ambiguous"),
        (("friction_patch",), -DECISIVE, "unknown"),
    ],
)
def test_what_a_formula_explains_as_well_is_contested(effects, ahead, expected):
    named, rival = Verdict("named", effects), law(50.0)
    own = candidate("+".join(effects), 50.0 + ahead)
    found = contested_by_law(named, ranked([own, rival]), DECISIVE)
    assert found.status == expected
    assert found.effects == (() if expected == "unknown" else effects)
    assert found.law == (rival.law if expected == "ambiguous" else None)
    assert contested_by_law(named, ranked([own, law(50.0, 0.001)]), DECISIVE) == named


@pytest.mark.parametrize(
    ("p_value", "behind", "expected"),
    [(0.5, DECISIVE - EDGE, "ambiguous"), (0.5, DECISIVE, "unknown"), (0.001, 1.0, "unknown")],
)
def test_a_form_that_leads_is_no_reason_to_hide_what_its_formula_does_not_beat(
    p_value, behind, expected
):
    """The form has no prior of a formula."""
    only_a_form = Verdict("unknown", (), FORM_OF_PULSE_T)
    form, formula = candidate(FORM_OF_PULSE_T, 52.0), law(50.0, family="pulse_t")
    own = candidate("friction_patch", 50.0 - behind, p_value)
    found = contested_by_law(only_a_form, ranked([form, formula, own]), DECISIVE)
    assert found.status == expected
    assert found.effects == (("friction_patch",) if expected == "ambiguous" else ())


def test_formulas_are_tried_where_nothing_explains_or_only_what_could_explain_much():
    patch = replace(candidate("friction_patch", 60.0), num_constants=3)
    two = replace(candidate("stribeck", 60.0), num_constants=2)
    pairs = [candidate("air_drag+rolling", 50.0), candidate("stribeck+rolling", 50.0)]
    table = ranked([candidate("air_drag", 50.0), patch, two, *pairs])
    assert needs_laws(Verdict("unknown", ()), table)
    assert needs_laws(Verdict("named", ("air_drag", "rolling")), table)
    assert needs_laws(Verdict("ambiguous", ("air_drag+rolling", "stribeck+rolling")), table)
    assert needs_laws(Verdict("named", ("friction_patch",)), table)
    assert not needs_laws(Verdict("named", ("stribeck",)), table)
    assert not needs_laws(Verdict("named", ("air_drag",)), table)
    assert not needs_laws(Verdict("ambiguous", ("air_drag", "stribeck+rolling")), table)


def test_a_second_factor_makes_a_formula_a_tenth_as_probable():
    assert law_odds(1) == pytest.approx(0.25)
    assert law_odds(2) == pytest.approx(0.025)


@pytest.mark.parametrize(("ahead", "expected"), [(0.0, "law"), (-EDGE, "law"), (EDGE, None)])
def test_a_factor_more_that_does_nothing_is_no_rival(ahead, expected):
    longer = law(50.0 + ahead, family="linear_q*power_v", name="law_2")
    found = status(law(50.0), longer)
    assert found == expected


def test_a_longer_formula_of_other_factors_is_a_rival():
    assert status(law(50.0), law(49.0, family="linear_q*power_t", name="law_2")) is None


# What the library says as well.


@pytest.mark.parametrize(
    ("beside", "is_doubted"),
    [
        (candidate("stribeck", 20.0, 1e-6), True),
        (candidate("stribeck", 50.0 - EDGE), True),
        (candidate("stribeck", 50.0 + EDGE), False),
        (candidate("stribeck+air_drag", 60.0), True),  # two effects may say what one would
        (candidate(FORM_OF_POWER_V, 60.0), True),  # nor has a form a name
    ],
)
def test_a_law_is_doubted_unless_one_effect_is_ahead(beside, is_doubted):
    best = law(50.0)
    single = candidate("rolling", 1.0, 1e-9)
    assert law_to_doubt(ranked([best, beside, single])) == (
        ranked([best, beside, single])[int(beside.log_odds > 50.0)] if is_doubted else None
    )


def test_what_leaves_more_than_noise_is_not_doubted_but_no_law():
    assert law_to_doubt(ranked([law(50.0, 1e-6), candidate("rolling", 1.0, 1e-9)])) is None


def needs(single: Candidate, is_named: bool = True) -> bool:
    verdict = Verdict("named", single.effects) if is_named else Verdict("unknown", ())
    return is_law_needed(verdict, ranked([single]), law(50.0), DECISIVE)


def test_a_law_is_not_needed_where_an_effect_says_it_as_well():
    assert not needs(candidate("stribeck", 50.0 - DECISIVE + EDGE))
    assert needs(candidate("stribeck", 50.0 - DECISIVE))
    assert needs(candidate("stribeck", 60.0), is_named=False)


@pytest.mark.parametrize(("constants", "is_needed"), [(2, False), (3, True)])
def test_many_constants_need_the_law_s_word(constants, is_needed):
    assert needs(replace(candidate("friction_patch", 60.0), num_constants=constants)) == is_needed


def test_what_is_near_a_formula_is_compared_where_its_form_is_ahead():
    """The form is no rival of its own formula; what is near the formula is."""
    rival = law(49.0, None, family="power_t", name="law_2")
    table = ranked([candidate(FORM_OF_POWER_V, 55.0, None), law(50.0, None), rival])
    assert [c.name for c in to_compare((*table, candidate("air_drag", 1.0)), DECISIVE)] == [
        FORM_OF_POWER_V,
        "law_1",
        "law_2",
        "air_drag",
    ]
    other_form = ranked([candidate(FORM_OF_PULSE_T, 55.0, None), law(50.0, None), rival])
    assert "law_2" not in [c.name for c in to_compare((*other_form, candidate("air_drag", 1.0)), 3)]
