"""`sweep` as a function: what it returns and reports, pages, cancelling; fits are made up."""

import json
import shutil
import threading

import pytest

from galileo_jax.runtime.errors import InputError
from galileo_jax.runtime.progress import Cancelled
from galileo_jax.sweeping import run_cells
from galileo_jax.sweeping import sweep as sweeping
from galileo_jax.sweeping.sweep import sweep
from galileo_jax.sweeping.work import CellResult
from tests.clip.broken_clips import build_good_track

ENTRY = {"mean": 0.25, "sd": 0.02, "q025": 0.21, "q975": 0.29, "unit": "1", "identified": True}
ERROR = {"rmse": 0.02, "noise": 0.01, "chi2_per_dof": 1.0}
DOCUMENT = {"converged": True, "parameters": {"k1": ENTRY}, "derived": {}, "error": ERROR}


@pytest.fixture
def clips(tmp_path):
    """Two clips of the same name in folders of their own."""
    made = []
    for name in ("anna", "ben"):
        (tmp_path / name).mkdir()
        made.append(build_good_track(tmp_path / name))
    # Another content, so that they are two cells.
    made[1].with_suffix(".yaml").write_text(made[1].with_suffix(".yaml").read_text() + "\n# ben\n")
    return made


@pytest.fixture
def computed(monkeypatch):
    """The folders that pages were asked for, cell by cell."""
    made = []

    def compute(settings, measured, page_folder):
        made.append(page_folder)
        if settings.seed == 13:
            raise InputError("an unlucky seed")
        page = {} if page_folder is None else {"report.html": b"<title>a page</title>"}
        return CellResult(DOCUMENT, page)

    monkeypatch.setattr(run_cells, "run_cell", compute)
    return made


def test_from_a_mapping(clips, computed, tmp_path):
    reported = []
    found = sweep(
        {"clips": clips, "grid": {"seed": [0, 13]}},
        out=tmp_path / "out",
        workers=0,
        on_progress=lambda *one: reported.append(one),
    )
    assert list(found.rows["status"]) == ["done", "done", "failed", "failed"]
    assert list(found.failures["failure"]) == ["an unlucky seed"] * 2
    assert found.report_path.is_file() and all(path.is_file() for path in found.tables)
    assert "2 cells done, 2 failed" in repr(found)
    assert "an unlucky seed" in found._repr_html_()
    shares = [share for _, share, _ in reported]
    assert shares == sorted(shares) and (shares[0], shares[-1]) == (0.0, 1.0)
    partials = [partial for *_, partial in reported if partial is not None]
    assert partials[0] == {"cells": 4, "done": 0, "folder": tmp_path / "out"}
    assert [one["why"] for one in partials[1:3]] == ["an unlucky seed"] * 2
    assert partials[3] is found
    again = json.loads((tmp_path / "out" / "sweep.json").read_text())["command"].split()
    assert again[:2] == ["galileo", "sweep"] and again[3:] == ["--out", str(tmp_path / "out")]
    computed.clear()
    assert list(sweep(again[2], out=again[4], workers=0).rows["cell"]) == list(found.rows["cell"])
    assert not computed, "the command that the page names is the same sweep"


def test_clips_of_one_name_are_told_apart(clips, computed, tmp_path):
    page = sweep({"clips": clips}, out=tmp_path / "out", workers=0).report_path.read_text()
    assert '<th scope="row">anna/clip</th>' in page
    assert '<th scope="row">ben/clip</th>' in page


def test_pages_up_to_so_many_cells_unless_the_config_says(clips, computed, tmp_path, monkeypatch):
    config = {"clips": clips, "grid": {"seed": [0, 1]}}
    monkeypatch.setattr(sweeping, "MOST_PAGES", 3)
    found = sweep(config, out=tmp_path / "out", workers=0)
    assert computed == [None] * 4
    assert "cells/" not in found.report_path.read_text()
    computed.clear()
    cells = [found.folder / "cells" / name for name in found.rows["cell"]]
    assert sweep(config, out=tmp_path / "out", workers=0) and not computed
    asked = {**config, "reports": True}
    found = sweep(asked, out=tmp_path / "out", workers=0)
    assert computed == cells, "pages that are asked for are made though there are results"
    page = found.report_path.read_text()
    assert page.count('href="cells/') == 4
    assert page.count(">grad seed 1</a>") == 2, "pages of one clip are told apart"
    assert sweep(asked, out=tmp_path / "out", workers=0) and len(computed) == 4
    monkeypatch.setattr(sweeping, "MOST_PAGES", 4)
    shutil.rmtree(tmp_path / "out")
    sweep(config, out=tmp_path / "out", workers=0)
    assert computed[4:] == cells
    sweep({**config, "reports": False}, out=tmp_path / "other", workers=0)
    assert computed[8:] == [None] * 4


def test_cancelled_between_two_cells_and_taken_up_again(clips, computed, tmp_path):
    cancel = threading.Event()

    def stop(stage, share, partial):
        if stage == "cells, 1 of 2 done":
            cancel.set()

    with pytest.raises(Cancelled):
        sweep({"clips": clips}, out=tmp_path / "out", workers=0, on_progress=stop, cancel=cancel)
    assert len(computed) == 1
    found = sweep({"clips": clips}, out=tmp_path / "out", workers=0)
    assert len(computed) == 2 and list(found.rows["status"]) == ["done", "done"]


def test_a_fit_that_is_cancelled_is_no_failure(clips, tmp_path, monkeypatch):
    def compute(settings, measured, page_folder):
        raise Cancelled("cancelled")

    monkeypatch.setattr(run_cells, "run_cell", compute)
    with pytest.raises(Cancelled):
        sweep({"clips": clips}, out=tmp_path / "out", workers=0)
    assert not list((tmp_path / "out").glob("cells/*"))


@pytest.mark.parametrize(
    ("given", "line"),
    [
        ({"engine": "slurm"}, "--engine: unknown engine 'slurm'; known: local, ray"),
        ({"address": "a:1"}, "--address: for --engine ray only"),
        ({"workers": -1}, "--workers: -1 is not a whole number, 0 or more"),
        ({"cpus_per_worker": 0}, "--cpus-per-worker: 0 is not a whole number, 1 or more"),
        ({"config": {}}, "config: clips: missing"),
        ({"config": {"clips": ["x.csv"], "reports": "no"}}, "config: reports: "),
    ],
)
def test_wrong_calls_are_one_sentence(given, line, tmp_path):
    with pytest.raises(InputError) as error:
        sweep(**{"config": {"clips": ["x.csv"]}, "out": tmp_path / "out"} | given)
    assert line in str(error.value)
    assert not (tmp_path / "out").exists()
