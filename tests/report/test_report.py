"""The page: self-contained, with the numbers, and plain about what is not known."""

import json
import re
from dataclasses import replace
from html.parser import HTMLParser

import numpy as np
import pytest

from galileo_jax.report import write_report
from galileo_jax.report.fitted import evaluate
from galileo_jax.report.statements import fit_quality, number, undetermined
from galileo_jax.run import load_run
from tests.oracle_run import HIT, MISS, PARTS, STILL, make_run
from tests.reference_ramp import solve


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    made = make_run(tmp_path_factory.mktemp("hit"), HIT, 1.6)
    return load_run(made.folder, "c")


@pytest.fixture(scope="module")
def page(run):
    return write_report(run).read_text(encoding="utf-8")


class References(HTMLParser):
    """Collects whatever a browser would fetch."""

    def __init__(self):
        super().__init__()
        self.found, self.tags = [], set()

    def handle_starttag(self, tag, attrs):
        self.tags.add(tag)
        self.found += [v for k, v in attrs if k in ("src", "href", "xlink:href", "srcset", "data")]


def test_needs_nothing_from_outside(page):
    references = References()
    references.feed(page)
    assert references.found
    assert all(text.startswith(("#", "data:image/")) for text in references.found)
    assert not references.tags & {"script", "link", "iframe"}
    assert not re.search(r"url\((?!#)", page) and "@import" not in page


def test_states_the_numbers(run, page):
    for name in ("k1", "k2"):
        entry = run.result["parameters"][name]
        assert f"<b>{number(entry['mean'], entry['sd'])}</b>" in page
        assert number(entry["q975"], entry["sd"]) in page
    for name in run.result["nuisances"]:
        assert f"<code>{name}</code>" in page
    assert f"{run.result['error']['chi2_per_dof']:.2f}" in page
    assert "--method mh" in page and "--seed 3" in page and run.result["version"] in page
    assert "only the ratio of the masses shows" in page


def test_has_every_figure_and_leaves_them_as_files(run, page):
    names = {path.stem for path in (run.folder / "plots").glob("*.svg")}
    objects = run.problem.observation.names
    assert names == {
        *(f"{kind}_{o}_{a}" for kind in ("velocity", "position") for o in objects for a in "xy"),
        *(f"residuals_{o}" for o in objects),
        "pairs",
        "trace",
    }
    assert page.count("<svg") == len(names)


def test_the_same_run_gives_the_same_page(run, page):
    assert write_report(run).read_text(encoding="utf-8") == page


def test_names_from_outside_are_escaped(run):
    hostile = replace(run, result=run.result | {"clips": ["<b>&.mp4"]})
    assert "<h1>&lt;b&gt;&amp;.mp4</h1>" in write_report(hostile).read_text(encoding="utf-8")


def test_what_an_earlier_fit_left_is_gone_and_the_thesis_is_no_posterior(run):
    thesis = {"method": "grad", "preset": "thesis", "best": {"k1": 0.123}}
    page = write_report(replace(run, result=run.result | thesis)).read_text(encoding="utf-8")
    assert not (run.folder / "plots" / "trace.svg").exists()
    assert "no posterior" in page and "k1 = 0.123" in page and "--preset thesis" in page


def test_residuals_are_whitened_and_the_hit_is_found(run):
    fitted = evaluate(run, seed=0)
    assert fitted.residuals.std() == pytest.approx(1.0, abs=0.6)
    assert fitted.hit_s == pytest.approx(solve(HIT, np.zeros(1)).hit_s, abs=0.02)
    assert [phase.name for phase in fitted.phases[0]] == ["ramp", "foot", "table", "after the hit"]


def test_the_hit_of_objects_that_part_is_where_the_closed_form_has_it(tmp_path):
    fitted = evaluate(make_run(tmp_path, PARTS, 1.8), seed=0)
    assert fitted.hit_s == pytest.approx(solve(PARTS, np.zeros(1)).hit_s, abs=0.02)


def not_identified(run, *names):
    """The run as if the clip had not told `names`."""
    result = json.loads(json.dumps(run.result))
    for room in ("parameters", "derived"):
        for name in names:
            if name in result[room]:
                result[room][name]["identified"] = False
    return replace(run, result=result)


def test_says_why_a_parameter_is_not_told(tmp_path):
    cases = (
        (MISS, "k2", "never hits"),
        (MISS, "mass_ratio", "never hits"),
        (STILL, "k1", "k1 is at least tan(angle) = 0.364"),
        (STILL, "k2", "nothing moves"),
    )
    made = {case: make_run(tmp_path / str(i), case, 1.0) for i, case in enumerate((MISS, STILL))}
    for case, name, why in cases:
        run = not_identified(made[case], name)
        assert why in undetermined(run, evaluate(run, seed=0))[name]


@pytest.mark.parametrize(
    ("chi2", "said"),
    [(0.3, "better than it claims"), (1.1, "size of the tracking noise"), (2, "see the residuals"),
     (50, "do not trust"), (None, "cannot be told")],
)  # fmt: skip
def test_chi2_is_put_in_words(chi2, said):
    assert said in fit_quality({"error": {"chi2_per_dof": chi2}})


def test_numbers_have_the_places_their_uncertainty_allows():
    assert number(0.151812, 0.00036) == "0.15181"
    assert number(123.4, 17.0) == "123"
    assert number(None, 1.0) == "n/a"
    assert number(0.25, 0.0) == "0.25"
