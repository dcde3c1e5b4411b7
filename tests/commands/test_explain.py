"""`galileo FILE`: which words are files, one line without a terminal, questions at one."""

import os
import pty
import re
import select
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
import yaml

from galileo_jax import __main__
from galileo_jax.commands import command, explain
from tests.api.test_understand import filmed

T = np.arange(30) / 25
ONLY_ASKS = """
import sys
from galileo_jax.commands import command, explain
def main(files):
    for clip in explain._clips(files, {}):
        print("angle", clip.ramp_angle_deg, clip.scenario)
sys.exit(command.run(main))
"""


@pytest.fixture
def table(tmp_path) -> Path:
    """Of a slope, which does not say its unit."""
    path = tmp_path / "slide.csv"
    rows = "\n".join(f"{t:.4f};{0.4 * t**2:.5f}" for t in T)
    path.write_text(f"t (s);s\n{rows}\n")
    return path


def at_terminal(argv: list[str], answers: list[str], limit_s: float = 60.0) -> tuple[int, str]:
    """Runs a program at a pseudo-terminal; answers each line that ends with ': '."""
    ours, theirs = pty.openpty()
    process = subprocess.Popen(argv, stdin=theirs, stdout=theirs, stderr=theirs, close_fds=True)
    os.close(theirs)
    told, asked_at, left = "", 0, list(answers)
    end = time.monotonic() + limit_s
    while time.monotonic() < end:
        if not select.select([ours], [], [], 0.1)[0]:
            if process.poll() is not None:
                break
            continue
        try:
            got = os.read(ours, 65536)
        except OSError:  # Linux: the other end is closed
            break
        if not got:
            break
        told += got.decode(errors="replace")
        if left and told.endswith(": ") and len(told) > asked_at:
            os.write(ours, f"{left.pop(0)}\n".encode())
            asked_at = len(told)
    if process.poll() is None:
        try:
            process.wait(10.0)
        except subprocess.TimeoutExpired:
            process.kill()
            process.wait()
            raise AssertionError(f"it waits: {told}") from None
    os.close(ours)
    return process.returncode, told


@pytest.mark.parametrize("word", ["slide.mp4", "a/b", "./fit", "a.folder/", ".", "drop.csv"])
def test_what_is_meant_for_a_file(word):
    assert explain.looks_like_a_file(word)


@pytest.mark.parametrize("word", ["fti", "--out", "-x.y", "diagnoze"])
def test_what_is_meant_for_a_verb(word, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert not explain.looks_like_a_file(word)


def test_a_folder_that_is_there_is_a_file_and_a_verb_stays_a_verb(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "trials").mkdir()
    (tmp_path / "fit").mkdir()
    assert command.run(__main__.main, ["trials"]) == 2
    assert "no film and no table in this folder" in capsys.readouterr().err
    assert command.run(__main__.main, ["fit"]) == 2
    assert "galileo fit: the following arguments are required" in capsys.readouterr().err


@pytest.mark.parametrize("word", ["none.csv", "none/none.mp4"])
def test_a_file_that_is_not_there_is_one_line(word, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    assert command.run(__main__.main, [word]) == 2
    out, err = capsys.readouterr()
    assert out == "" and err == f"error: {word}: no such file\n"


def test_without_a_terminal_one_line_names_every_missing_key(table, monkeypatch, capsys):
    monkeypatch.chdir(table.parent)
    assert command.run(__main__.main, [table.name]) == 2
    out, err = capsys.readouterr()
    assert out == "" and err.count("\n") == 1
    for word in ("scenario", "track_units", "ramp_angle_deg", "--ramp-angle 20", "slide.yaml"):
        assert word in err
    assert [path.name for path in table.parent.iterdir()] == [table.name], "nothing is written"


def test_answers_in_the_call_are_written_down(table, monkeypatch, capsys):
    monkeypatch.chdir(table.parent)
    said = {"scenario": "incline", "track_units": "m", "ramp_angle_deg": 20.0}
    (clip,) = explain._clips([table.name], said)
    assert clip.ramp_angle_deg == 20.0
    assert yaml.safe_load(table.with_suffix(".yaml").read_text())["ramp_angle_deg"] == 20.0
    assert "the next call asks nothing" in capsys.readouterr().err


def test_of_several_nothing_is_written_where_one_is_wrong(table, monkeypatch):
    monkeypatch.chdir(table.parent)
    other = table.with_name("other.csv")
    other.write_text("time of day;place\nnoon;here\n")
    call = [table.name, other.name, "--scenario", "incline", "--track-units", "m"]
    assert command.run(__main__.main, [*call, "--ramp-angle", "20"]) == 2
    assert not table.with_suffix(".yaml").exists()


def test_at_a_terminal_what_is_open_is_asked_once(table):
    call = [sys.executable, "-c", ONLY_ASKS, str(table)]
    code, told = at_terminal(call, ["", "parsec", "m", "", "21.5"])
    assert code == 0, told
    assert "scenario [incline]: " in told and "perhaps incline: one coordinate" in told
    assert "one of m, cm" in told, "a wrong answer is asked for again"
    assert "ramp_angle_deg: an answer is needed" in told, "no angle is made up"
    assert "angle 21.5 incline" in told
    written = yaml.safe_load(table.with_suffix(".yaml").read_text())
    assert (written["track"], written["track_units"]) == (table.name, "m")
    code, told = at_terminal(call, [])
    assert code == 0 and "angle 21.5 incline" in told
    assert ": " not in told and "?" not in re.sub(r"\x1b\S+", "", told), "it asks nothing"


def test_the_end_of_the_input_stops_it_and_nothing_is_written(table):
    call = [sys.executable, "-c", ONLY_ASKS, str(table)]
    code, told = at_terminal(call, ["", "\x04"])
    assert code == 2 and "no answer; nothing was written" in told
    assert not table.with_suffix(".yaml").exists()


def test_a_paragraph_then_the_table_of_the_fit(tmp_path, monkeypatch, capsys):
    import galileo_jax as gx

    monkeypatch.chdir(tmp_path)
    gx.simulate("board.csv", scenario="incline", seed=3, track_only=True)
    assert command.run(__main__.main, ["board.csv"]) == 0
    out, err = capsys.readouterr()
    said, table = out.split("\n\n")
    assert said.startswith("The block slid with a friction coefficient of 0.15")
    assert table.splitlines()[0].split() == ["truth", "mean", "sd", "95", "%", "interval"]
    assert "runs/board/report.html, runs/board/result.json" in err
    assert Path("runs/board/report.html").is_file()


def test_who_stops_it_while_it_asks_what_is_missing_has_the_fit(tmp_path, monkeypatch, capsys):
    import galileo_jax as gx
    from galileo_jax.api import explain as api

    def interrupt(*_, **__):
        raise KeyboardInterrupt

    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(api, "diagnose_fitted", interrupt)
    gx.simulate(
        "board.csv", scenario="incline", seed=3, effects=["air_drag"], strength=1, track_only=True
    )
    assert command.run(__main__.main, ["board.csv"]) == 130
    out, err = capsys.readouterr()
    told, last = err.split("\n\n")
    assert not out and "So far: The block slid with a friction coefficient of " in told
    assert "The data contradict the model (p" in " ".join(told.split())
    assert told.endswith("kept in runs/board") and last.startswith("stopped; kept: board.yaml")
    assert {"report.html", "result.json"} <= {one.name for one in Path("runs/board").iterdir()}


@pytest.mark.video
def test_a_picture_goes_with_the_questions_about_a_film(tmp_path, monkeypatch):
    run = 5.0 * np.clip(np.arange(30.0) - 3, 0, 18)
    film = filmed(tmp_path, np.stack([50 + run, 40 + 0.5 * run, 0 * run], axis=1))
    seen, browser = tmp_path / "seen", tmp_path / "browser"
    browser.write_text(f'#!/bin/sh\necho "$1" > {seen}\n')
    browser.chmod(0o755)
    monkeypatch.setenv("DISPLAY", ":99")
    monkeypatch.setenv("BROWSER", str(browser))
    monkeypatch.chdir(tmp_path)
    busy = ONLY_ASKS.replace("def main", "import time\ndef main").replace(
        "print(", "time.sleep(3); print("
    )
    call = [sys.executable, "-c", busy, film.name]
    # The program goes on for long after the questions; here the browser gets its time so.
    code, told = at_terminal(call, ["20", "900"])
    assert code == 0, told
    picture = tmp_path / "runs" / "clip" / "what_moves.png"
    assert told.count("what_moves.png: the first picture") == 1 and picture.is_file()
    assert seen.read_text().strip() == picture.as_uri()
    picture.unlink()
    code, told = at_terminal(call, [])
    assert code == 0 and not picture.exists(), "no question, no picture"


def test_without_a_display_nothing_is_opened_and_what_fails_is_not_told(monkeypatch):
    opened: list[str] = []

    def broken(url: str) -> None:
        opened.append(url)
        raise OSError(url)

    monkeypatch.setattr(explain.webbrowser, "open", broken)
    monkeypatch.setattr(explain.sys, "platform", "linux")
    for key in ("DISPLAY", "WAYLAND_DISPLAY"):
        monkeypatch.delenv(key, raising=False)
    explain.show(Path("a.png"))
    assert opened == []
    monkeypatch.setenv("WAYLAND_DISPLAY", "wayland-0")
    explain.show(Path("a.png"))
    end = time.monotonic() + 5
    while not opened and time.monotonic() < end:
        time.sleep(0.01)
    assert len(opened) == 1
