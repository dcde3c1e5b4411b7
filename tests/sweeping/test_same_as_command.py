"""A sweep's cell is what the command writes, byte for byte but for times; nothing is made up here.

On a video of a ramp, a track of one in metres, a flight and a fall, all from the package's own
simulation.
"""

import re
from pathlib import Path

import pytest

from galileo_jax.commands import command, diagnose, fit, simulate
from galileo_jax.sweeping.sweep import sweep
from tests.precision import in_64_bit

MADE = {
    "ramp.csv": ["--track-only", "--seconds", "1.2"],
    "ramp.mp4": ["--size", "320x180", "--seconds", "1.2"],
    "flight.csv": ["--track-only", "--scenario", "flight"],
    "fall.csv": ["--track-only", "--scenario", "fall"],
}
CLIPS = tuple(MADE)
TIMES = re.compile(r'"timings_s": \{[^}]*\}|"[a-z_]*seconds": [0-9.e-]+')
MH = {"method": "mh", "chains": 4, "max_steps": 25}
THESIS = {"method": "thesis", "chains": 2, "acceptance": "metropolis", "seed": 1}
WORDS = {  # settings of a cell and the words of the command that do the same
    "grad": ({"method": "grad", "seed": 3}, ["--method", "grad", "--seed", "3"]),
    "cnn": ({"method": "cnn"}, ["--method", "cnn"]),
    "mh": (MH, ["--method", "mh", "--chains", "4", "--max-steps", "25"]),
    "thesis": (
        THESIS,
        [
            *("--method", "mh", "--preset", "thesis", "--chains", "2"),
            *("--acceptance", "metropolis", "--seed", "1"),
        ],
    ),
    "noise": ({"method": "grad", "noise": "tracker"}, ["--noise", "tracker"]),
    "effects": ({"method": "grad", "effects": ["air_drag"]}, ["--effects", "air_drag"]),
}


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    made = tmp_path_factory.mktemp("clips")
    for name, words in MADE.items():
        assert command.run(simulate.main, ["--seed", "4", "--out", str(made / name), *words]) == 0
    return made


@pytest.fixture(autouse=True)
def surroundings(folder, monkeypatch):
    """Clips are named from the working folder, and commands compute in 64 bit."""
    monkeypatch.chdir(folder.parent)
    with in_64_bit():
        yield


def of_cell(clips, settings, out):
    """What the only cell of a sweep writes."""
    found = sweep(
        {"clips": [clips], "common": settings, "reports": False}, out=out / "sweep", workers=0
    )
    assert list(found.rows["status"]) == ["done"], list(found.rows["failure"])
    return found.folder / "cells" / found.summary[0]["cell"] / "result.json"


def of_command(main, words, out, name="result.json"):
    assert command.run(main, [*words, "--out", str(out / "run")]) == 0
    return out / "run" / name


def without_times(path: Path) -> str:
    text = path.read_text()
    assert TIMES.search(text), "it says how long it took"
    return TIMES.sub("", text)


def check_fit(clips, how, out):
    settings, words = WORDS[how]
    cell, written = of_cell(clips, settings, out), of_command(fit.main, [*clips, *words], out)
    assert without_times(cell) == without_times(written)
    assert f'"{clips[0]}"' in cell.read_text(), "a clip is called what it was called"


@pytest.mark.parametrize("clip", CLIPS)
def test_gradient_fit(clip, folder, tmp_path):
    check_fit([f"{folder.name}/{clip}"], "grad", tmp_path)


def test_network(folder, tmp_path):
    check_fit([f"./{folder.name}/ramp.csv"], "cnn", tmp_path)


@pytest.mark.slow
@pytest.mark.parametrize("clip", CLIPS)
@pytest.mark.parametrize("how", ["mh", "cnn", "thesis"])
def test_other_methods(clip, how, folder, tmp_path, capfd):
    """Where the command refuses a method, so does the cell, with the same sentence."""
    name = f"{folder.name}/{clip}"
    settings, words = WORDS[how]
    if command.run(fit.main, [name, *words, "--out", str(tmp_path / "try")]) == 0:
        check_fit([name], how, tmp_path)
        return
    said = capfd.readouterr().err.strip().splitlines()[-1]
    found = sweep({"clips": [name], "common": settings}, out=tmp_path / "sweep", workers=0)
    assert list(found.failures["failure"]) == [said.removeprefix("error: ")]


@pytest.mark.slow
@pytest.mark.parametrize("how", ["noise", "effects"])
def test_options(how, folder, tmp_path):
    check_fit([f"{folder.name}/ramp.csv"], how, tmp_path)


@pytest.mark.slow
def test_trials_together(folder, tmp_path):
    names = [f"{folder.name}/again_{i}.csv" for i in (1, 2)]
    words = ["--track-only", "--series", "2", "--out", f"{folder.name}/again.csv"]
    assert command.run(simulate.main, words) == 0
    check_fit(names, "grad", tmp_path)


def check_diagnosis(clip, out):
    cell = of_cell([clip], {"method": "diagnose"}, out)
    written = of_command(diagnose.main, [clip], out, "diagnosis.json")
    assert without_times(cell) == without_times(written)


def test_diagnosis_of_a_fall(folder, tmp_path):
    check_diagnosis(f"{folder.name}/fall.csv", tmp_path)


@pytest.mark.slow
@pytest.mark.parametrize("clip", ["ramp.csv", "ramp.mp4", "flight.csv"])
def test_diagnosis(clip, folder, tmp_path):
    check_diagnosis(f"{folder.name}/{clip}", tmp_path)
