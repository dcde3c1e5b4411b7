"""`galileo compare`: compare.json by contract, clips and runs, wrong calls in one line."""

import json

import pytest

from galileo_jax.commands import command, compare
from galileo_jax.comparison.compare import comparison_document
from tests.found import comparison_of, make_trials
from tests.oracle_run import HIT, make_run
from tests.precision import in_64_bit

PLACE = {"object", "axis", "phase", "rmse", "noise", "z"}


@pytest.fixture(autouse=True)
def precision():
    with in_64_bit():
        yield


def test_the_document_keeps_the_contract(tmp_path):
    comparison = comparison_of(make_trials(tmp_path), 1e-9)
    document = json.loads(json.dumps(comparison_document(comparison)))
    assert document["adequate"] is False
    assert document["p_value"] == 1e-9
    assert all(set(place) >= PLACE for place in document["where"])
    assert document["where"][0]["phase"] == "ramp", "the worst first"
    assert [pull["parameter"] for pull in document["pulls"]] == ["release_instant"]
    assert set(document["error"]) >= {"rmse", "noise", "chi2_per_dof"}


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    with in_64_bit():
        return make_run(tmp_path_factory.mktemp("oracle"), HIT, 1.6)


@pytest.mark.slow
def test_a_run_and_its_clip_say_the_same(run, tmp_path, capsys):
    """The closed form is the model: it is adequate; the run's own report is left alone."""
    report = run.folder / "report.html"
    report.write_text("of the fit")
    assert command.run(compare.main, [str(run.folder)]) == 0
    told = capsys.readouterr().out
    of_run = json.loads((run.folder / "compare" / "compare.json").read_text())
    assert report.read_text() == "of the fit"
    assert (run.folder / "compare" / "report.html").is_file()
    clip = run.folder.parent / "oracle.yaml"
    assert command.run(compare.main, [str(clip), "--out", str(tmp_path / "out")]) == 0
    of_clip = json.loads((tmp_path / "out" / "compare.json").read_text())
    assert of_clip["adequate"] == of_run["adequate"]
    assert of_clip["p_value"] == pytest.approx(of_run["p_value"], rel=0.2)
    assert told.startswith("The model is ")
    assert "object1" in told
