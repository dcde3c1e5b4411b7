"""The closed loop with tiny labs: what goes wrong costs one experiment and a line, nothing else.

The diagnosis is stood in for by one that counts clips: the loop is what is tested here.
"""

import json
import types
from typing import Any

import numpy as np
import pytest

import galileo_jax as gx
from galileo_jax.api import discover as module
from galileo_jax.diagnosis.diagnosis import Law, Verdict
from galileo_jax.experiment.choose import Expected
from galileo_jax.experiment.lab import LabError, described
from galileo_jax.runtime.errors import InputError

CLIP = {
    "scenario": "incline",
    "objects": [{"name": "object1", "shape": "box", "size_m": [0.06, 0.06, 0.06]}],
}
SETTINGS = {"height_m": {"low": 0.1, "high": 0.5}, "angle_deg": {"choices": [20.0]}}

LAW = Law("a = -0.8 |v|^1.5 sign(v), all objects", "power_v", "", {"c": "0.8", "n": "1.5"})


class Lab:
    """Answers with what it is told to, in turn; a track where nothing is left to tell."""

    def __init__(self, *answers, settings=SETTINGS):
        self.answers, self.asked, self.settings = list(answers), [], settings

    def describe(self):
        return described({"settings": self.settings, "clip": CLIP})

    def measure(self, settings):
        self.asked.append(dict(settings))
        answer = self.answers.pop(0) if self.answers else track(len(self.asked))
        if isinstance(answer, BaseException):
            raise answer
        return answer


def track(seed: int) -> str:
    t = np.arange(30) / 30
    noise = 1e-4 * np.random.default_rng(seed).standard_normal((2, 30))
    along, slope = t**2 - 0.877, np.radians(20)  # of the point under a centre 3 cm above
    x = along * np.cos(slope) + 0.03 * np.sin(slope) + noise[0]
    rows = zip(t, x, 0.03 * np.cos(slope) - along * np.sin(slope) + noise[1], strict=True)
    lines = [",".join(f"{value:.7f}" for value in row) for row in rows]
    return "\n".join(["time_s,object1_x_m,object1_y_m", *lines]) + "\n"


@pytest.fixture
def verdicts(monkeypatch):
    """What is diagnosed, in turn; then ambiguous for ever. Holds the clips of every diagnosis."""
    given: Any = types.SimpleNamespace(statuses=[], clips=[])

    def diagnose(clips, **_):
        given.clips.append([str(clip) for clip in clips])
        status = given.statuses.pop(0) if given.statuses else "ambiguous"
        if isinstance(status, BaseException):
            raise status
        effects = {
            "named": ("air_drag",),
            "ambiguous": ("air_drag", "rolling"),
            "law": ("law_drag_v_power",),
        }.get(status, ())
        law = LAW if status == "law" else None
        return types.SimpleNamespace(
            verdict=Verdict(status, effects, law=law),
            sentence=f"it is {status}",
            document={"p_value": 0.5},
            found=None,
            problem=None,
            measurements=[types.SimpleNamespace(clip=None)],
            save=lambda folder: folder.mkdir(exist_ok=True),
        )

    def expect(clip, trials, beliefs, settings, about, seed):
        return [Expected(one, one["height_m"], 0.9, 1.0, None) for one in settings]

    beliefs = types.SimpleNamespace(by_name={"air_drag": 0.6, "rolling": 0.4})

    monkeypatch.setattr(module, "diagnose", diagnose)
    monkeypatch.setattr(module, "expect", expect)
    monkeypatch.setattr(module, "beliefs_of", lambda _: beliefs)
    return given


def test_it_ends_when_the_verdict_has_stood(verdicts, tmp_path):
    verdicts.statuses = ["ambiguous", "named", "named"]
    lab, told = Lab(), []
    found = gx.discover(
        lab, out=tmp_path / "run", on_progress=lambda _, share, part: told.append((share, part))
    )
    assert (found.status, found.effects) == ("named", ("air_drag",))
    assert [len(clips) for clips in verdicts.clips] == [1, 2, 3], "all clips together"
    assert lab.asked[0] == {"height_m": 0.3, "angle_deg": 20.0}, "the middle"
    assert lab.asked[1]["height_m"] == 0.5, "where the gain is largest"
    document = json.loads((tmp_path / "run" / "discover.json").read_text())
    assert [one["outcome"] for one in document["experiments"]] == ["track"] * 3
    assert "nothing is known yet" in document["experiments"][0]["reason"]
    assert document["experiments"][1]["reason"] == (
        "largest expected gain: 0.50 nats; the true hypothesis is then named with probability "
        "0.90; so far: air_drag 0.60, rolling 0.40"
    )
    assert document["ended"] == "the verdict (named) is the same in successive rounds"
    assert "it is named" in (tmp_path / "run" / "report.html").read_text()
    shares = [share for share, _ in told]
    assert shares == sorted(shares) and shares[-1] == 1.0
    assert len([part for _, part in told if part and "experiment" in part]) == 3
    assert list(found.experiments.columns[:2]) == ["number", "settings"]


def test_a_law_is_left_with_its_formula(verdicts, tmp_path):
    verdicts.statuses = ["unknown", "law", "law"]
    found = gx.discover(Lab(), out=tmp_path)
    document = json.loads((tmp_path / "discover.json").read_text())
    assert [one["law"] for one in document["rounds"]] == [
        None,
        *[{"text": LAW.text, "family": "power_v", "constants": {"c": 0.8, "n": 1.5}}] * 2,
    ]
    assert (
        document["ended"] == "the verdict (law) is the same in successive rounds"
        and found.status == "law"
    )
    assert "a = -0.8 |v|^1.5" in (tmp_path / "report.html").read_text()


@pytest.mark.parametrize(
    ("answer", "line"),
    [
        (LabError("exit code 3"), "exit code 3"),
        (ZeroDivisionError("by zero"), "by zero"),
        ("", "an empty answer"),
        ("no csv at all", "column 'no csv at all': unknown"),
        ("time_s,object1_x_m,object1_y_m\n0,0,0\n", "at least 4 expected"),
        (track(9).replace("object1", "cart"), "cart"),
        (track(9).replace("0.0333333", "ten"), "ten"),
        (
            "time_s,object1_x_m,object1_y_m\n"
            + "".join(f"{i / 30},{np.sin(99 * i * i)},{np.cos(7 * i * i)}\n" for i in range(40)),
            "scatter by",
        ),
        (track(1), "the same track as in experiment 1"),
    ],
)
def test_what_a_lab_does_wrong_costs_one_experiment_and_a_line(answer, line, verdicts):
    verdicts.statuses = ["ambiguous", "named", "named"]
    found = gx.discover(Lab(track(1), answer), budget=16)
    outcomes = [one["outcome"] for one in found.document["experiments"]]
    assert outcomes == ["track", "lost", "track", "track"]
    lost = found.document["experiments"][1]
    assert line in lost["line"] and "\n" not in lost["line"]
    assert found.status == "named"
    assert len(verdicts.clips) == 3, "nothing is diagnosed twice"
    again = [one["settings"] for one in found.document["experiments"]]
    assert again[1] not in again[2:], "not where it failed"


def test_one_that_repeats_itself_at_another_angle_is_said_to(verdicts):
    """Not that its objects hang above the ramp, though at that angle they do."""
    settings = {"height_m": {"low": 0.29, "high": 0.31}, "angle_deg": {"low": 10, "high": 30}}
    found = gx.discover(Lab(track(1), track(1), settings=settings), budget=2)
    assert found.document["experiments"][1]["settings"]["angle_deg"] != 20
    assert found.document["experiments"][1]["line"] == "the same track as in experiment 1"


def test_a_track_that_cannot_be_diagnosed_costs_one_experiment(verdicts):
    verdicts.statuses = ["ambiguous", np.linalg.LinAlgError("Singular matrix"), "named", "named"]
    found = gx.discover(Lab())
    outcomes = [one["outcome"] for one in found.document["experiments"]]
    assert outcomes == ["track", "lost", "track", "track"]
    assert found.document["experiments"][1]["line"] == "cannot be diagnosed: Singular matrix"
    assert [len(clips) for clips in verdicts.clips] == [1, 2, 2, 3]


def test_a_lab_that_never_gives_a_track_ends_with_the_budget(verdicts):
    lab = Lab(*[LabError("out of order")] * 9)
    found = gx.discover(lab, budget=4)
    assert len(lab.asked) == 4 and found.status is None and found.found is None
    assert found.sentence == "After 4 experiments: No experiment delivered a track."
    assert len({one["height_m"] for one in lab.asked}) == 4, "always somewhere else"


def test_the_budget_ends_what_stays_open(verdicts):
    found = gx.discover(Lab(), budget=3)
    assert found.status == "ambiguous" and len(found.experiments) == 3
    assert found.document["ended"] == "the budget of 3 experiments is spent"


@pytest.mark.parametrize("where", ["measure", "diagnose"])
def test_interrupted_it_goes_on_where_it_was(where, verdicts, tmp_path):
    verdicts.statuses = ["ambiguous", "named", "named"]
    lab = Lab(track(1), KeyboardInterrupt())
    if where == "diagnose":
        lab = Lab(track(1), track(2))
        verdicts.statuses = ["ambiguous", KeyboardInterrupt(), "named", "named"]
    with pytest.raises(KeyboardInterrupt):
        gx.discover(lab, out=tmp_path)
    before = json.loads((tmp_path / "discover.json").read_text())
    assert len(before["experiments"]) == 2 and len(before["rounds"]) == 1
    second = Lab(track(3), track(4))
    found = gx.discover(second, out=tmp_path)
    assert len(second.asked) == (2 if where == "measure" else 1), "what was measured is kept"
    assert found.status == "named" and len(found.experiments) == 3
    assert found.document["experiments"][0] == before["experiments"][0]
    if where == "measure":
        assert second.asked[0] == before["experiments"][1]["settings"], (
            "the one that was broken off"
        )

    third = Lab()
    done = gx.discover(third, out=tmp_path)
    assert third.asked == [] and done.document["rounds"] == found.document["rounds"]


def test_broken_off_before_it_was_saved_the_diagnosis_is_made_again(verdicts, tmp_path):
    verdicts.statuses = ["named", "named", "named"]
    gx.discover(Lab(), out=tmp_path)
    (tmp_path / "diagnosis").rmdir()
    lab = Lab()
    gx.discover(lab, out=tmp_path)
    assert (tmp_path / "diagnosis").is_dir() and lab.asked == []
    assert verdicts.clips[2] == verdicts.clips[1], "of the same clips"
    gx.discover(lab, out=tmp_path)
    assert len(verdicts.clips) == 3, "once"


def test_what_cannot_be_rehearsed_is_tried_all_the_same(verdicts, monkeypatch):
    def refuse(*_):
        raise InputError("--can: height has no place in scenario spring")

    monkeypatch.setattr(module, "expect", refuse)
    lab = Lab()
    found = gx.discover(lab, budget=3)
    assert "not simulated (--can: height has no place" in found.experiments["reason"][1]
    assert len({one["height_m"] for one in lab.asked}) == 3


def test_a_folder_that_cannot_be_written(verdicts, tmp_path):
    (tmp_path / "file").write_text("")
    with pytest.raises(InputError, match=r"--out: .*file/run \(Not a directory\)"):
        gx.discover(Lab(), out=tmp_path / "file" / "run")


def test_more_budget_goes_on(verdicts, tmp_path):
    gx.discover(Lab(), budget=2, out=tmp_path)
    lab = Lab(track(11), track(12))
    found = gx.discover(lab, budget=4, out=tmp_path)
    assert len(lab.asked) == 2 and len(found.experiments) == 4


def test_the_same_seed_asks_the_same(verdicts):
    one, other = Lab(), Lab()
    gx.discover(one, budget=3, seed=4)
    gx.discover(other, budget=3, seed=4)
    assert one.asked == other.asked


def test_what_may_not_vary_within_a_series_is_held(verdicts):
    settings = {
        **SETTINGS,
        "mass2_kg": {"low": 0.2, "high": 0.8},
        "swap": {"choices": [False, True]},
        "colour": {"choices": ["red", "blue"]},
    }
    lab = Lab(settings=settings)
    found = gx.discover(lab, budget=3)
    held = {"mass2_kg": 0.5, "swap": False, "colour": "red"}
    assert found.document["held"] == held
    assert all(one.items() >= held.items() for one in lab.asked)


def test_a_lab_with_nothing_to_set_is_asked_the_same_again(verdicts):
    lab = Lab(settings={"colour": {"choices": ["red"]}})
    gx.discover(lab, budget=2)
    assert lab.asked == [{"colour": "red"}] * 2


def test_wrong_calls(verdicts, tmp_path):
    (tmp_path / "file").write_text("")
    mute = Lab()
    mute.describe = lambda: (_ for _ in ()).throw(LabError("--describe: a JSON object expected"))
    for lab, options, line in (
        (Lab(), {"budget": 0}, "--budget: 0 is not a number of experiments"),
        (Lab(), {"timeout": 0.0}, "--timeout: 0 is not a time"),
        (Lab(), {"out": tmp_path / "file"}, "a file; a folder expected|is a file"),
        (mute, {}, "LAB: --describe: a JSON object expected"),
        (tmp_path / "none", {}, "no such program"),
        (Lab(settings={"angle_deg": {"low": 5, "high": 95}}), {}, "outside 1 to 89 degrees"),
    ):
        with pytest.raises(InputError, match=line):
            gx.discover(lab, **options)  # pyright: ignore[reportArgumentType]
    gx.discover(Lab(), budget=1, out=tmp_path / "run")
    with pytest.raises(InputError, match="of another lab"):
        gx.discover(Lab(settings={"fps": {"choices": [30]}}), out=tmp_path / "run")
    (tmp_path / "run" / "discover.json").write_text("[")
    with pytest.raises(InputError, match="not the journal of a discovery"):
        gx.discover(Lab(), out=tmp_path / "run")


@pytest.mark.slow
def test_a_saved_diagnosis_is_as_good_as_one_in_memory(tmp_path):
    gx.simulate(
        tmp_path / "slide.csv",
        scenario="incline",
        seed=6,
        effects={"viscous_drag": {}},
        strength=0.2,
        track_only=True,
    )
    found = gx.diagnose(tmp_path / "slide.csv")
    found.save(tmp_path / "run")
    here = gx.next_experiment(found, can="height=0.1:0.4")
    there = gx.next_experiment(tmp_path / "run", can="height=0.1:0.4")
    gains = [one.document["settings"] for one in (here, there)]
    assert gains[0] == gains[1] and here.hypotheses == there.hypotheses
