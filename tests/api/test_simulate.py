"""`simulate`: the function and the command write the same bytes, refuse with the same sentence."""

import itertools
import json
import threading
from pathlib import Path

import jax
import pytest

from galileo_jax.api.simulate import Simulated, simulate
from galileo_jax.clip.load import load_clip
from galileo_jax.commands import command
from galileo_jax.commands import simulate as simulate_command
from galileo_jax.runtime.errors import InputError
from galileo_jax.runtime.progress import Cancelled

SMALL = {"size": (160, 90), "seconds": 0.3}


def contents(folder: Path) -> dict[str, bytes]:
    return {path.name: path.read_bytes() for path in folder.iterdir()}


SAME = {
    "track": ("c.csv", "--track-only --seed 2", {"track_only": True, "seed": 2}),
    "values": (
        "c.csv",
        "--track-only --scenario multi --m1 1 --k2 0.2 --set k3=0.2 --angle 15 --fps 60",
        {
            "track_only": True,
            "scenario": "multi",
            "m1": 1,  # whole numbers are numbers, too
            "k2": 0.2,
            "values": {"k3": 0.2},
            "angle": 15,
            "fps": 60,
        },
    ),
    "effect": (
        "c.csv",
        "--track-only --effect stribeck:stribeck=1.5 --effect air_drag --strength 0.5 --faults",
        {
            "track_only": True,
            "effects": {"stribeck": {"stribeck": 1.5}, "air_drag": {}},
            "strength": 0.5,
            "faults": True,
        },
    ),
    "fall": (
        "c.csv",
        "--track-only --scenario fall --floor --effect air_drag",
        {"track_only": True, "scenario": "fall", "floor": True, "effects": ["air_drag"]},
    ),
    "series": (
        "c.csv",
        "--track-only --series 2 --seconds 0.5",
        {"track_only": True, "series": 2, "seconds": 0.5},
    ),
    "video": (
        "c.mp4",
        "--size 160x90 --seconds 0.3 --hand --camera-fault roll --direction left",
        {**SMALL, "hand": True, "camera_fault": "roll", "direction": "left"},
    ),
}


@pytest.mark.video
@pytest.mark.parametrize("name", SAME)
@pytest.mark.parametrize("is_64_bit", [False, True])
def test_the_function_writes_what_the_command_writes(name, is_64_bit, tmp_path, capsys):
    file, words, given = SAME[name]
    by_command, by_function = tmp_path / "command", tmp_path / "function"
    assert (
        command.run(simulate_command.main, [*words.split(), "--out", f"{by_command}/{file}"]) == 0
    )
    printed = capsys.readouterr().out
    with jax.enable_x64(is_64_bit):
        made = simulate(by_function / file, **given)
        assert jax.config.read("jax_enable_x64") == is_64_bit
    assert capsys.readouterr() == ("", "")
    assert contents(by_function) == contents(by_command)
    assert printed.split() == [str(by_command / path.name) for path in made.paths]


WRONG = [
    ("c.csv", "--angle 95", {"angle": 95}),
    ("c.csv", "--k1 nan", {"k1": float("nan")}),
    ("c.csv", "--seed -1", {"seed": -1}),
    ("c.csv", "--set k1=3", {"values": {"k1": 3.0}}),
    ("c.csv", "--set k9=1", {"values": {"k9": 1.0}}),
    ("c.csv", "--effect drag", {"effects": ["drag"]}),
    ("c.csv", "--effect air_drag:c=1", {"effects": {"air_drag": {"c": 1.0}}}),
    ("c.csv", "--effect air_drag:air_drag=x", {"effects": {"air_drag": {"air_drag": "x"}}}),
    ("c.csv", "--effect rolling --effect rolling", {"effects": ["rolling", "rolling"]}),
    ("c.csv", "--scenario flihgt", {"scenario": "flihgt"}),
    ("c.csv", "--shapes box,ball", {"shapes": ["box", "ball"]}),
    ("c.csv", "--shapes box", {"shapes": ["box"]}),
    ("c.csv", "--solver exact", {"solver": "exact"}),
    ("c.csv", "--strength 1", {"strength": 1.0}),
    ("c.csv", "--effects-from none.py", {"effects_from": "none.py"}),
    ("c.csv", "--floor", {"floor": True}),
    ("c.csv", "--z2 0.01", {"z2": 0.01}),
    ("c.csv", "--hand", {"hand": True}),
    ("c.csv", "--camera-fault roll", {"camera_fault": ["roll"]}),
    ("c.csv", "--size 320x180", {"size": (320, 180)}),
    ("c.csv", "--scenario flight --angle 25", {"scenario": "flight", "angle": 25}),
    ("c.csv", "--scenario spring --floor", {"scenario": "spring", "floor": True}),
    ("c.csv", "--scenario spring --set k1=1", {"scenario": "spring", "values": {"k1": 1.0}}),
    ("c.csv", "--scenario incline --k2 0.1", {"scenario": "incline", "k2": 0.1}),
    ("c.csv", "--motion free --solver fine", {"motion": "free", "solver": "fine"}),
    ("c.csv", "--motion free --scenario fall", {"motion": "free", "scenario": "fall"}),
    ("c.mp4", "", {"track_only": True}),
    ("/proc/none/c.csv", "", {}),
]
WRONG_VIDEO = [
    ("c.csv", "", {}),
    ("c.mp4", "--size 641x360", {"size": (641, 360)}),
    ("c.mp4", "--size 640", {"size": 640}),
    ("c.mp4", "--track-noise 0.001", {"track_noise": 0.001}),
    ("c.mp4", "--motion free", {"motion": "free"}),
    ("c.mp4", "--camera-fault rol", {"camera_fault": "rol"}),
    ("c.mp4", "--direction up", {"direction": "up"}),
]
WRONG_CALLS = [
    *(
        (file, f"--track-only {words}", {"track_only": True, **given})
        for file, words, given in WRONG
    ),
    *WRONG_VIDEO,
]


@pytest.mark.parametrize(("file", "words", "given"), WRONG_CALLS)
def test_wrong_calls_are_refused_with_the_commands_sentence(
    file, words, given, tmp_path, capsys, monkeypatch
):
    monkeypatch.chdir(tmp_path)
    assert command.run(simulate_command.main, [*words.split(), "--out", file]) == 2
    sentence = capsys.readouterr().err
    with pytest.raises(InputError) as caught:
        simulate(file, **given)
    assert f"error: {caught.value}\n" == sentence
    assert list(tmp_path.iterdir()) == []


def test_names_have_suggestions(tmp_path):
    with pytest.raises(InputError, match="unknown scenario 'flihgt'; did you mean flight"):
        simulate(tmp_path / "c.mp4", scenario="flihgt")


def test_what_it_returns(tmp_path):
    made = simulate(tmp_path / "c.csv", track_only=True, series=2, seconds=0.5, effects=["rolling"])
    assert isinstance(made, Simulated)
    assert made.clips == (tmp_path / "c_1.csv", tmp_path / "c_2.csv")
    assert set(made.paths) == set(tmp_path.iterdir())
    assert made.truths[1] == json.loads((tmp_path / "c_2.truth.json").read_text())
    assert load_clip(made.clips[0]).frame_count == made.truths[0]["frames"]
    assert repr(made) == f"<Simulated {made.clips[0]}, {made.clips[1]}>"
    assert "<td>rolling</td>" in made._repr_html_()


@pytest.mark.video
def test_progress_is_reported_from_0_to_1(tmp_path):
    reports = []
    simulate(tmp_path / "c.mp4", **SMALL, on_progress=lambda *report: reports.append(report))
    shares = [share for _, share, _ in reports]
    assert shares == sorted(shares)
    assert (shares[0], shares[-1]) == (0.0, 1.0)
    assert [stage for stage, _ in itertools.groupby(stage for stage, _, _ in reports)] == [
        "simulating",
        "rendering",
        "writing",
    ]


@pytest.mark.video
def test_cancelled_it_leaves_nothing(tmp_path):
    cancel = threading.Event()

    def on_progress(stage, share, partial):
        if stage == "rendering":
            cancel.set()

    with pytest.raises(Cancelled):
        simulate(tmp_path / "c.mp4", **SMALL, on_progress=on_progress, cancel=cancel)
    assert list(tmp_path.iterdir()) == []


EFFECT_FILE = '''
from typing import ClassVar

from galileo_jax.model.effects.effect import Effect
from galileo_jax.model.effects.registry import register
from galileo_jax.model.parameters import Normal, Parameter


@register
class Steady(Effect):
    """A steady force on object 1."""

    name: ClassVar[str] = "steady_of_a_file"

    def parameters(self, scene):
        return (Parameter(self.name, "N", Normal(0.0, 0.2), 0.0, "effect"),)

    def force(self, theta, scene):
        size = scene.only(theta[self.name], 0)
        return lambda state: size + 0.0 * state.path_m
'''


def test_like_takes_the_file_of_the_effect_that_is_hidden_there(tmp_path, effects_restored):
    file, sealed = tmp_path / "steady.py", tmp_path / "sealed.csv"
    file.write_text(EFFECT_FILE)
    hidden = {"steady_of_a_file": {}}
    simulate(sealed, effects=hidden, effects_from=file, track_only=True)
    like = sealed.with_suffix(".truth.json")
    made = simulate(tmp_path / "again.csv", like=like, effects_from=file, track_only=True)
    assert made.truths[0]["effect"] == "steady_of_a_file"
