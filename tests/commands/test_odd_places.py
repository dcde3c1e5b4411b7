"""Folders that cannot be written to, and paths with blanks and letters beyond ASCII."""

from pathlib import Path

import pytest

from galileo_jax import __main__
from galileo_jax.commands import command
from tests.clip.broken_clips import build_good_track
from tests.precision import in_64_bit


@pytest.fixture(autouse=True)
def precision():
    with in_64_bit():
        yield


@pytest.mark.parametrize("verb", ["explain", "fit", "compare", "diagnose"])
def test_a_read_only_working_folder_is_said_at_once(
    verb, nobody_can_write, tmp_path, monkeypatch, capsys
):
    clip = build_good_track(tmp_path)
    monkeypatch.chdir(nobody_can_write)
    assert command.run(__main__.main, [verb, str(clip)]) == 2
    out, err = capsys.readouterr()
    assert out == ""
    assert err.count("\n") == 1
    assert f"--out: nothing can be written to runs/{clip.stem} (" in err


@pytest.mark.parametrize(
    "call", ["compare {run} --out x", "predict {run} --seconds 1 --out x", "next {run} --out x"]
)
def test_so_it_is_before_a_run_is_read(call, nobody_can_write, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(nobody_can_write)
    assert command.run(__main__.main, call.format(run=tmp_path).split()) == 2
    assert capsys.readouterr().err.startswith("error: --out: nothing can be written to x (")


def test_a_track_that_cannot_be_written_is_one_line(nobody_can_write, monkeypatch, capsys):
    monkeypatch.chdir(nobody_can_write)
    call = ["simulate", "--seed", "7", "--track-only", "--out", "x.csv"]
    assert command.run(__main__.main, call) == 2
    assert capsys.readouterr().err.startswith("error: --out: x.csv: ")


@pytest.mark.video
def test_blanks_and_umlauts_are_letters_like_others(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    film = Path("Über Reibung") / "Rutsche 1 ä.mp4"
    assert command.run(__main__.main, ["simulate", "--seed", "7", "--out", str(film)]) == 0
    assert command.run(__main__.main, ["track", str(film), "--out", "Spur ö"]) == 0
    assert "Spur ö/track_m.csv" in capsys.readouterr().out
    names = {path.name for path in Path("Spur ö").iterdir()}
    assert names == {"track_px.csv", "track_m.csv", "overlay.png", "overlay.mp4"}
