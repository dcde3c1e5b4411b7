"""The page of a diagnosis: every verdict is told, scripts run, nothing comes from outside."""

from dataclasses import replace
from html import escape
from itertools import chain
from pathlib import Path

import numpy as np
import pytest

from galileo_jax.clip.load import load_clip
from galileo_jax.comparison.compare import comparison_document
from galileo_jax.comparison.path_residuals import failing_interval, path_residuals
from galileo_jax.comparison.phases import PHASES
from galileo_jax.diagnosis.diagnosis import Law, Verdict
from galileo_jax.diagnosis.document import diagnosis_document
from galileo_jax.report import diagnosis_text
from galileo_jax.report.diagnosis_page import (
    before_after_charts,
    write_comparison_page,
    write_diagnosis_page,
)
from galileo_jax.report.draw import write_svgs
from galileo_jax.report.provenance import digest
from tests.found import ERROR, LAW, comparison_of, diagnosis_of, fit_of
from tests.report.browser import opened
from tests.report.references import check_needs_nothing_from_outside

pytestmark = pytest.mark.usefixtures("precision")
STATUSES = ("none", "named", "ambiguous", "unknown")
SAYS = {
    "none": "The model is adequate: no effect is missing",
    "named": "air_drag explains the data (p = 1e-09 without, p = 0.4 with)",
    "ambiguous": "This clip cannot distinguish between air_drag and viscous_drag",
    "unknown": "see the missing force",
}
LAW_SAYS = (
    f"No formula explains the missing force. The best one, {LAW.text}, leaves more than noise "
    "(p = 0.0003, chi2 per degree of freedom 1.00, probability 0.01)."
)
GO_ON = "galileo fit a.yaml --effects air_drag"
AGAIN = "galileo diagnose a.yaml --seed 0"
HOSTILE = '</script><b>&"clip'


@pytest.fixture(scope="module")
def clip(trials, trials_folder):
    """The clip that the trials were made of, its second object a ball."""
    made = load_clip(trials_folder / "oracle.yaml")
    ball = made.objects[1].model_copy(update={"shape": "sphere", "size_m": (0.03,)})
    return made.model_copy(update={"objects": (made.objects[0], ball)})


def write_page(path, trials, diagnosis, clip, truth=None):
    told = {"truth": truth, "command": AGAIN, "next_command": GO_ON}
    fits = [(one.hypothesis.of(trials), one.hypothesis.fit) for one in diagnosis.rounds]
    models = [(own, own.theta(fit.z, fit.free)) for own, fit in fits]
    record, paths = record_of(trials, diagnosis), paths_of(trials, diagnosis)
    write_diagnosis_page(path, HOSTILE, record, paths, [clip], models, **told)


def record_of(trials, diagnosis):
    made = {"sentence": diagnosis_text.verdict(diagnosis), "engine": "rigid", "seed": 0}
    return diagnosis_document(trials, diagnosis, 0) | made


def paths_of(trials, diagnosis):
    return [
        path_residuals(trials, one.hypothesis.fit, one.comparison, 0) for one in diagnosis.rounds
    ]


@pytest.fixture(scope="module")
def page_of(trials, clip, tmp_path_factory):
    """The page of a verdict; made once, unless it is to be made anew."""
    made: dict[str, Path] = {}

    def page(status: str, is_anew: bool = False) -> Path:
        if status not in made or is_anew:
            made[status] = tmp_path_factory.mktemp(status) / "report.html"
            write_page(made[status], trials, diagnosis_of(trials, status), clip, "air_drag")
        return made[status]

    return page


@pytest.mark.parametrize(("left", "says"), [(1.2, True), (2.0, False)])
def test_what_takes_nearly_all_of_the_error_away_is_said_first(left, says, trials):
    found = diagnosis_of(trials, "unknown")
    best = replace(found.candidates[0], error=ERROR | {"chi2_per_dof": left})
    sentence = diagnosis_text.verdict(replace(found, candidates=(best, *found.candidates[1:])))
    said = "air_drag takes 93 % of the error away, though not all. "
    assert sentence.startswith(said if says else "No known effect explains the data")
    assert "No known effect explains the data" in sentence


@pytest.mark.parametrize("status", STATUSES)
def test_tells_the_verdict_and_needs_nothing_from_outside(status, page_of, clip):
    page = page_of(status).read_text(encoding="utf-8")
    assert SAYS[status] in page and GO_ON in page and "Truth: air_drag" in page
    assert "<h2" in page and "Why" in page and "the model without effects: p" in page
    assert ">none</td>" in page, "no effect is a hypothesis, too"
    assert ("The missing force" in page) == (status == "unknown")
    assert (escape(LAW_SAYS) in page) == (status == "unknown")
    assert ("Added: air_drag" in page) == (status in ("named", "ambiguous"))
    assert AGAIN in page and digest(clip.track) in page
    check_needs_nothing_from_outside(page)
    assert "<h1>&lt;/script&gt;&lt;b&gt;&amp;" in page, "names are escaped"


@pytest.mark.parametrize("status", ["named", "unknown"])
def test_draws_what_each_effect_changed(status, trials, tmp_path):
    found = diagnosis_of(trials, status)
    charts = before_after_charts(record_of(trials, found), paths_of(trials, found))
    plots = write_svgs(tmp_path, chain.from_iterable(charts.values()))
    added = [f"before_after_oracle_object{i}_air_drag.svg" for i in (1, 2)]
    assert [plot.name for plot in plots] == (added if status == "named" else [])
    assert all("before" in plot.read_text() or "no effects" in plot.read_text() for plot in plots)


def test_opens_in_a_browser(page_of, browser):
    models = ["no effects", "air_drag"]
    with opened(browser, page_of("named")) as (page, complaints):
        moved = page.eval_on_selector_all(
            "[data-of][transform]", "all => all.map(one => [one.dataset.of, one.dataset.object])"
        )
        assert page.locator("output").inner_text() == "0.00 s"
        assert page.locator("circle").count() >= 1, "the ball is one"
    assert sorted(moved) == sorted([name, i] for name in [*models, "measured"] for i in "01")
    assert complaints == []


def test_a_comparison_opens_in_a_browser(trials, clip, tmp_path, browser):
    comparison, fit = comparison_of(trials, 1e-9), fit_of(trials, ())
    path, told = tmp_path / "report.html", {"command": AGAIN, "is_adequate": False}
    record = comparison_document(comparison) | {"effects": [], "engine": "rigid", "seed": 0}
    paths, model = path_residuals(trials, fit, comparison, 0), trials.theta(fit.z, fit.free)
    write_comparison_page(path, HOSTILE, record, paths, [clip], (trials, model), **told)
    with opened(browser, path) as (page, complaints):
        assert page.locator(".chart").count() == 2
        document = page.content()
    assert complaints == []
    assert "The model is not adequate" in document
    assert "Object 1 is released 50 ms before the first frame, 5 standard deviations" in document
    assert "foot_transition" not in document, "inside its prior"


def test_the_same_diagnosis_gives_the_same_page(page_of):
    first = page_of("named").read_bytes()
    assert page_of("named", is_anew=True).read_bytes() == first


def test_the_worst_stretch_is_where_the_residuals_were_bent(trials):
    comparison = comparison_of(trials, 1e-9)
    bent, quiet = path_residuals(trials, fit_of(trials, ()), comparison, 0)
    times = bent.times_s
    assert bent.failing_s == pytest.approx((times[10], times[14]))
    assert bent.worst is not None and bent.worst.phase == "ramp"
    assert quiet.failing_s is None, "object 2 is as the model has it"
    fine = path_residuals(trials, fit_of(trials, ()), comparison_of(trials, 0.5), 0)
    assert all(one.failing_s is None for one in fine), "an adequate model fails nowhere"


def test_a_stretch_keeps_to_its_phase():
    white = np.zeros(30)
    white[5:9], white[20:29] = 3.0, 9.0
    labels = np.where(np.arange(30) < 15, PHASES.index("ramp"), PHASES.index("table"))
    assert failing_interval(white, labels, np.arange(30.0), "ramp") == (5.0, 8.0)
    assert failing_interval(white, labels, np.arange(30.0), "whole") == (20.0, 28.0)
    assert failing_interval(white, labels, np.arange(30.0), "held") is None


def test_a_fit_at_the_truth_lies_on_the_measured_path(trials):
    for one in path_residuals(trials, fit_of(trials, ()), comparison_of(trials, 0.5), 0):
        assert np.nanmax(np.abs(one.measured_m - one.predicted_m)) < 6e-3  # its foot is no bevel
        assert (one.low_m <= one.high_m).all()


def test_a_formula_that_does_as_well_is_shown(trials, clip, tmp_path):
    law = Law("a = -1.1 |v|^1.5 sign(v)", "power_v", "", {})
    found = diagnosis_of(trials, "ambiguous")
    first = replace(found.candidates[0], law=law)
    verdict = replace(found.verdict, effects=("viscous_drag",), law=law)
    found = replace(found, candidates=(first, *found.candidates[1:]), verdict=verdict)
    said = f"cannot distinguish between viscous_drag and the formula ({law.text}); each of them"
    assert said in diagnosis_text.verdict(found)
    page = tmp_path / "report.html"
    write_page(page, trials, found, clip)
    assert page.read_text(encoding="utf-8").count(escape(law.text)) >= 2  # verdict, candidates


def test_what_could_not_be_confused_is_one_line():
    """A formula is looked at beside every hypothesis: twenty lines that say the same."""
    apart = [{"rule": "told_apart", "sentence": f"rival {i}"} for i in range(20)]
    found = [{"rule": "explains", "sentence": "only noise is left"}, *apart]
    found.append({"rule": "not_told_apart", "sentence": "one could be confused"})
    said = diagnosis_text.why(found)
    assert said[:2] == ["only noise is left", "one could be confused"]
    assert len(said) == 3 and "20 others" in said[2]
    assert diagnosis_text.why(found[:2]) == ["only noise is left", "rival 0"]


@pytest.mark.parametrize(
    ("rivals", "said"),
    [
        (
            ("stribeck", "rolling", "air_drag"),
            "This clip cannot distinguish between stribeck, rolling and air_drag; each of them "
            "explains the data.",
        ),
        (
            ("table_tilt", "scale_error+table_tilt", "table_tilt+rolling"),
            "table_tilt explains the data alone or together with scale_error or rolling; this clip "
            "cannot tell which.",
        ),
        (
            ("air_drag+magnus", "magnus+viscous_drag"),
            "magnus explains the data together with air_drag or viscous_drag; this clip cannot "
            "tell which.",
        ),
        (
            (
                "friction_patch",
                "magnetic_brake",
                "friction_patch+rolling",
                "magnetic_brake+stribeck",
            ),
            "This clip cannot distinguish between friction_patch and magnetic_brake; each of them "
            "explains the data, alone or together with rolling or stribeck.",
        ),
        (
            ("air_drag", "stribeck+rolling", "air_drag+rolling"),
            "This clip cannot distinguish between air_drag and stribeck+rolling; each of them "
            "explains the data, alone or together with rolling.",
        ),
        (
            ("rolling", "rolling+stribeck"),
            "rolling explains the data alone or together with stribeck; this clip cannot tell "
            "which.",
        ),
    ],
)
def test_what_all_hypotheses_have_in_common_is_told_first(rivals, said):
    assert diagnosis_text.ambiguity(rivals) == said


def test_what_the_best_formula_says():
    """Of diagnosis.json: it explains the missing force, or not, or there is none."""
    leaves = {"p_value": 0.2, "chi2_per_dof": 0.9, "probability": 0.5}
    best = {"law": LAW.text, "explains": True, **leaves}

    def said(status: str, missing: dict | None) -> str:
        record: dict = {"verdict": {"status": status}}
        return diagnosis_text.formula_text(record | ({"missing_force": missing} if missing else {}))

    numbers = "(p = 0.2, chi2 per degree of freedom 0.90, probability 0.5)"
    assert said("law", {"best_formula": best}) == (
        f"A formula explains the missing force: {LAW.text} {numbers}."
    )
    assert "but it is not certain (see why)" in said("unknown", {"best_formula": best})
    none = said("unknown", {"best_formula": None})
    assert none == "No short formula was found that could explain the missing force."
    assert said("named", None) == ""


def test_how_to_go_on(trials):
    clips, mine = ["a b.yaml"], ["my.py"]
    cases = {
        "none": "galileo fit 'a b.yaml'",
        "named": "galileo fit 'a b.yaml' --effects-from my.py --effects air_drag",
        "ambiguous": "galileo fit 'a b.yaml' --effects-from my.py --effects air_drag",
        "unknown": "galileo diagnose 'a b.yaml' --effects-from my.py --effects-from my_effect.py",
    }
    for status, expected in cases.items():
        assert diagnosis_text.next_command(diagnosis_of(trials, status), clips, mine) == expected
    law = replace(diagnosis_of(trials, "named"), verdict=Verdict("law", ("law_drag",)))
    found = diagnosis_text.next_command(law, clips, [], Path("runs/a b"))
    assert found == (
        "galileo fit 'a b.yaml' --effects-from 'runs/a b/proposed_effect.py' --effects law_drag"
    )
