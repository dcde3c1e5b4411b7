"""The exam's scoring, and its walk over cases with a diagnosis that is made up."""

import json
import math

import pytest

from benchmarks import hidden_cases, hidden_effects
from benchmarks.__main__ import main
from benchmarks.verdicts import confusion, judge, missed_bars, summary
from galileo_jax.commands import command

LIBRARY = ("air_drag", "restitution", "stribeck", "viscous_drag")


def diagnosis(status: str, *effects: str, before: float = 9.0, after: float = 1.0) -> dict:
    history = [{"effects": [], "chi2_per_dof": before}, {"effects": [], "chi2_per_dof": after}]
    return {"verdict": {"status": status, "effects": list(effects)}, "history": history}


RIGHT, COVERED, WRONG, RECOGNISED = (
    "is_named_right",
    "is_covered",
    "is_confident_wrong",
    "is_recognised",
)


@pytest.mark.parametrize(
    ("truth", "said", "kind", "true"),
    [
        ("none", ("none",), "none", {RIGHT, COVERED}),
        ("none", ("named", "air_drag"), "none", {WRONG}),
        ("none", ("unknown",), "none", {WRONG, RECOGNISED}),
        ("air_drag", ("named", "air_drag"), "library", {RIGHT, COVERED}),
        ("air_drag", ("named", "stribeck"), "library", {WRONG}),
        ("air_drag", ("none",), "library", set()),
        ("air_drag", ("unknown",), "library", {RECOGNISED}),
        ("air_drag", ("ambiguous", "stribeck", "air_drag"), "library", {COVERED, RECOGNISED}),
        ("air_drag", ("ambiguous", "stribeck", "viscous_drag"), "library", {RECOGNISED}),
        ("air_drag", ("ambiguous", "air_drag", *LIBRARY[1:]), "library", {RECOGNISED}),
        ("restitution+air_drag", ("named", "air_drag", "restitution"), "library", {RIGHT, COVERED}),
        ("restitution+air_drag", ("named", "air_drag"), "library", {WRONG}),
        (
            "restitution+air_drag",
            ("ambiguous", "air_drag+restitution", "stribeck+restitution"),
            "library",
            {COVERED, RECOGNISED},
        ),
        ("exotic_gust", ("unknown",), "exotic", {RECOGNISED}),
        ("exotic_gust", ("ambiguous", "air_drag", "stribeck"), "exotic", {RECOGNISED}),
        ("exotic_gust", ("named", "air_drag"), "exotic", {WRONG}),
        ("exotic_gust", ("none",), "exotic", set()),
    ],
)
def test_one_case(truth, said, kind, true):
    score = judge(truth, LIBRARY, diagnosis(*said))
    assert score.kind == kind
    flags = (RIGHT, COVERED, WRONG, RECOGNISED)
    assert {flag for flag in flags if getattr(score, flag)} == true
    assert (score.before, score.after) == (3, 1)


def test_set_size_counts_only_where_the_truth_is_in_it():
    said = [("named", "air_drag"), ("ambiguous", "air_drag", "stribeck"), ("named", "stribeck")]
    sizes = [judge("air_drag", LIBRARY, diagnosis(*each)).set_size for each in said]
    assert sizes[:2] == [1, 2]
    assert math.isnan(sizes[2])


def test_figures_of_many_cases():
    said = [
        ("none", diagnosis("none")),
        ("none", diagnosis("named", "stribeck")),
        ("air_drag", diagnosis("named", "air_drag", after=1.21)),
        ("air_drag", diagnosis("named", "air_drag")),
        ("air_drag", diagnosis("ambiguous", "air_drag", "viscous_drag")),
        ("stribeck", diagnosis("none")),
        ("exotic_gust", diagnosis("unknown")),
        ("exotic_gust", diagnosis("named", "air_drag")),
    ]
    scores = [judge(truth, LIBRARY, each) for truth, each in said]
    figures = summary(scores)
    assert {key: figures[key] for key in ("none", "known", "exotic")} == {
        "none": 2,
        "known": 4,
        "exotic": 2,
    }
    expected = {
        "false_alarms": 0.5,
        "named_right": 0.5,
        "covered": 0.75,
        "mean_set_size": 4 / 3,
        "confident_wrong": 0,
        "missed": 0.25,
        "unknown_recognised": 0.5,
        "confident_wrong_exotic": 0.5,
        "noise_before": 3,
        "noise_after_worst": 1.1,
    }
    assert {key: figures[key] for key in expected} == pytest.approx(expected)
    assert confusion(scores)["air_drag"] == {"air_drag": 2, "air_drag or viscous_drag": 1}
    assert len(missed_bars(figures, is_series=False)) == 5
    assert missed_bars(summary(scores[2:4]), is_series=True) == []


def test_no_cases_of_a_kind_miss_no_bar():
    assert missed_bars(summary([judge("none", LIBRARY, diagnosis("none"))]), False) == []


def test_unknown_status_is_an_error():
    with pytest.raises(ValueError, match="maybe"):
        judge("none", LIBRARY, diagnosis("maybe"))


@pytest.fixture
def exam(monkeypatch):
    """The calls that a diagnosis got which always names air drag."""
    calls = []

    def run_diagnosis(yamls, out, seed):
        calls.append([path.name for path in yamls])
        assert all(path.is_file() for path in yamls)
        return diagnosis("named", "air_drag", before=4.0 if "_80" in yamls[0].name else 2.0)

    monkeypatch.setattr(hidden_effects, "run_diagnosis", run_diagnosis)
    return calls


def ran(*options):
    return command.run(main, ["hidden_effects", *map(str, options)])


def figures_of(capsys):
    return json.loads(capsys.readouterr().out.splitlines()[-1])


def test_only_what_has_a_place_on_a_ramp_is_hidden_there():
    names = hidden_cases.ramp_effects()
    assert {"air_drag", "restitution"} < set(names)
    assert "added_mass" not in names and "force_at_a_time" not in names


def test_grid_is_walked_once(exam, tmp_path, capsys, monkeypatch):
    monkeypatch.setattr(hidden_cases, "EXOTICS", ())
    monkeypatch.setattr(hidden_cases, "PAIRS", ())
    options = ["--effects", "air_drag", "--strengths", "0.1", "0.8", "--seeds", "1", "--none", "1"]
    options += ["--series", "2", "--out", tmp_path / "exam"]
    assert ran(*options) == 0
    assert exam == [
        [f"{name}_1.yaml", f"{name}_2.yaml"]
        for name in ("air_drag_10_0", "air_drag_80_0", "none_0")
    ]
    figures = figures_of(capsys)
    assert figures["too_weak"] == 1
    assert figures["too_weak_by_effect"]["air_drag"]["known"] == 1
    assert (figures["known"], figures["named_right"], figures["false_alarms"]) == (1, 1, 1)
    assert figures["by_strength"].keys() == {"0.8"}
    assert ran(*options) == 0
    assert len(exam) == 3
    assert figures_of(capsys)["benchmark"] == "hidden_effects"


def test_folder_of_clips_made_elsewhere(exam, tmp_path, capsys):
    clips = tmp_path / "clips"
    clips.mkdir()
    for name, effect in (("a_1", "air_drag"), ("b_1", "none"), ("c_1", "exotic_ripple")):
        (clips / f"{name}.truth.json").write_text(json.dumps({"effect": effect, "series": None}))
        (clips / f"{name}.yaml").write_text("")
    options = [clips, "--out", tmp_path / "exam"]
    assert ran(*options) == 0
    assert exam == [["a_1.yaml"], ["b_1.yaml"], ["c_1.yaml"]]
    figures = figures_of(capsys)
    assert (figures["named_right"], figures["false_alarms"]) == (1, 1)
    assert figures["confident_wrong_exotic"] == 1
    assert ran(*options, "--series", 2) == 2
