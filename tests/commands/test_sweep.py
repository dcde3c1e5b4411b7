"""`galileo sweep`: cells, failures, resuming, tables and page; the fits themselves are made up."""

import csv
import json

import pytest

from galileo_jax.commands import command, sweep
from galileo_jax.runtime.errors import InputError
from galileo_jax.sweeping import run_cells
from galileo_jax.sweeping.work import CellResult
from tests.clip.broken_clips import build_good_track
from tests.missing import needed_module
from tests.report.browser import opened
from tests.sweeping.stopped import stopping

TRUTH = {"m1": 0.4, "k1": 0.2, "m2": 0.2, "k2": 0.3, "effect": "air_drag"}


@pytest.fixture
def clips(tmp_path):
    """Three clips, with a truth beside the first; the last has a wrong key."""
    made = []
    for name in "abc":
        folder = tmp_path / name
        folder.mkdir()
        clip = build_good_track(folder)
        for suffix in (".csv", ".yaml"):
            text = clip.with_suffix(suffix).read_text().replace("clip.csv", f"{name}.csv")
            (tmp_path / f"{name}{suffix}").write_text(text)
        made.append(tmp_path / f"{name}.yaml")
    (tmp_path / "a.truth.json").write_text(json.dumps(TRUTH))
    made[2].write_text(made[2].read_text() + "\ngravitation: 9.81\n")
    return made


@pytest.fixture
def calls(monkeypatch):
    """The cells that were computed; what is computed is made up."""
    made = []

    def compute(settings, measured, page_folder):
        made.append((settings.method, settings.seed, measured[0].name))
        page = {} if page_folder is None else {"report.html": b"<title>a page</title>"}
        if settings.seed == 13:
            raise InputError("an unlucky\nseed")
        entry = {"mean": 0.25 + 0.01 * settings.seed, "sd": 0.02, "q025": 0.21, "q975": 0.29}
        entry |= {"unit": "1", "identified": True}
        row = {"effects": [], "rmse": 0.02, "noise": 0.01, "chi2_per_dof": 1.5}
        if settings.method == "diagnose":
            verdict = {"status": "named", "effects": ["air_drag"]}
            last = row | {"k1": entry, "effects": ["air_drag"]}
            document = {"adequate": False, "p_value": 1e-9, "verdict": verdict}
            return CellResult(document | {"history": [row, last]}, page)
        quantities = {"k1": entry, "k2": entry}
        derived = {"mass_ratio": entry}
        document = {"converged": True, "parameters": quantities, "derived": derived}
        return CellResult(document | {"error": row}, page)

    monkeypatch.setattr(run_cells, "run_cell", compute)
    return made


def run(tmp_path, clips, text, *more, out="out"):
    path = tmp_path / "plan.yaml"
    path.write_text(f"clips: {json.dumps([str(clip) for clip in clips])}\n{text}")
    words = [str(path), "--out", str(tmp_path / out), "--workers", "0", *more]
    return command.run(sweep.main, words)


def rows_of(folder):
    with (folder / "summary.csv").open() as stream:
        return list(csv.DictReader(stream))


def test_every_cell_is_a_row_and_what_fails_is_told(tmp_path, clips, calls, capsys):
    text = "list: [{method: grad}, {method: grad, seed: 13}, {method: diagnose}]"
    assert run(tmp_path, clips, text) == 0
    rows = rows_of(tmp_path / "out")
    assert [(r["method"], r["seed"]) for r in rows[::3]] == [
        ("grad", "0"), ("grad", "13"), ("diagnose", "0"),
    ]  # fmt: skip
    assert [r["status"] for r in rows] == ["done", "done", "failed", *["failed"] * 3,
                                           "done", "done", "failed"]  # fmt: skip
    assert rows[2]["failure"].startswith(f"{clips[2]}: gravitation: unknown key")
    assert rows[3]["failure"] == "an unlucky seed"
    assert float(rows[0]["k1_error"]) == pytest.approx(0.05)
    assert float(rows[0]["mass_ratio_true"]) == 2.0
    assert (rows[0]["k1_covered"], rows[0]["k2_covered"]) == ("False", "False")
    assert rows[1]["k1_error"] == "", "no truth is known"
    assert (rows[6]["hidden"], rows[6]["verdict"]) == ("air_drag", "air_drag")
    told = capsys.readouterr()
    assert "4 cells done, 5 failed" in told.out
    assert "failed: a-grad-" in told.err
    for row in rows:
        folder = tmp_path / "out" / "cells" / row["cell"]
        names = ["report.html", "result.json"] if row["status"] == "done" else ["failure.json"]
        assert sorted(path.name for path in folder.iterdir()) == names
    parquet = needed_module("pyarrow.parquet")
    table = parquet.read_table(tmp_path / "out" / "summary.parquet").to_pylist()
    assert [row["cell"] for row in table] == [row["cell"] for row in rows]
    assert table[0]["k1"] == 0.25 and table[0]["converged"] is True


def test_goes_on_where_it_was_stopped(tmp_path, clips, calls, monkeypatch, capsys):
    text = "grid: {seed: [0, 1, 2, 13]}"
    assert run(tmp_path, clips[:2], text, out="whole") == 0
    assert len(calls) == 8
    calls.clear()
    with monkeypatch.context() as patched:
        patched.setattr(run_cells, "run_cell", stopping(run_cells.run_cell, 3))
        assert run(tmp_path, clips[:2], text) == 130
    assert run(tmp_path, clips[:2], text) == 0
    assert len(calls) == len(set(calls)) == 8, "none is lost, and none computed twice"
    for name in ("summary.csv", "summary.parquet"):
        whole = tmp_path / "whole" / name
        if whole.exists():
            assert whole.read_bytes() == (tmp_path / "out" / name).read_bytes()
    assert run(tmp_path, clips[:2], text) == 0
    assert len(calls) == 8, "a failure is kept, too"
    assert run(tmp_path, clips[:2], text, "--retry") == 0
    assert len(calls) == 10


def test_a_wrong_call_is_one_line_and_nothing_is_computed(tmp_path, clips, calls, capsys):
    wrong = {
        "common: {seed: -1}": "plan.yaml: common.seed: ",
        "common: {effects: [air_drga]}": "effects: unknown 'air_drga'; known: added_mass, ",
        "list: [{method: diagnose, add: glue}]": "effects: unknown 'glue'",
    }
    for text, line in wrong.items():
        assert run(tmp_path, clips, text) == 2
        assert line in capsys.readouterr().err
    assert run(tmp_path, clips, "common: {}", "--address", "auto") == 2
    assert "--address: for --engine ray only" in capsys.readouterr().err
    assert not calls and not (tmp_path / "out").exists()


def test_multirun_is_one_sweep(tmp_path, clips, calls):
    assert run(tmp_path, clips[:1], "common: {}", "--multirun", "common.seed=0,1,1") == 0
    assert [row["seed"] for row in rows_of(tmp_path / "out")] == ["0", "1"]


def test_the_page_shows_errors_and_what_was_taken_for_what(tmp_path, clips, calls, browser):
    text = "list: [{method: grad}, {method: grad, seed: 13}, {method: diagnose}]"
    assert run(tmp_path, clips[:1], text) == 0
    with opened(browser, tmp_path / "out" / "report.html") as (page, complaints):
        for width_px in (1280, 390):
            page.set_viewport_size({"width": width_px, "height": 900})
            page.wait_for_function(f"document.documentElement.scrollWidth <= {width_px}")
        seen = page.inner_text("main")
        for words in ("Error by effect", "Error by method", "an unlucky seed"):
            assert words in seen
        assert "1 of 1 are correct" in seen
        assert page.locator(".plot.js-plotly-plot").count() == 6
        assert page.locator(".share").all_inner_texts() == ["1"], "the confusion matrix"
        assert not complaints
