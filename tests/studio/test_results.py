"""What the page shows of files and results, without a page."""

import json

import pytest

from galileo_jax.studio import charts
from galileo_jax.studio.panels.diagnose import friction_moves, stairs
from galileo_jax.studio.results import (
    Results,
    pixel_track,
    round_of,
    with_partial,
    with_round,
)
from galileo_jax.studio.session import Session
from tests.studio.clips import clip_in

MOTION = {
    "clip": "a",
    "objects": ["object1"],
    "times": [0.0, 0.1, 0.2],
    "x": [[0.0, 0.01, None]],
    "sd_x": [[0.001, 0.001, 0.001]],
    "model_x": [[0.0, 0.011, 0.02]],
    "y": [[0.0, 0.0, None]],
    "sd_y": [[0.001, 0.001, 0.001]],
    "model_y": [[0.0, 0.0, 0.0]],
    "white": [[[0.1, -0.3, None], [0.0, 0.2, None]]],
}


def row(*effects: str, rmse: float = 0.01) -> dict:
    frictions = {"k1": {"mean": 0.1 + 0.05 * (not effects), "sd": 0.001}}
    return {
        "effects": list(effects),
        "rmse": rmse,
        "noise": 0.001,
        "chi2_per_dof": 2.0,
        **frictions,
    }


def test_a_round_is_a_step_and_removing_it_goes_back():
    rounds = with_round([row()], row("air_drag", rmse=0.002))
    rounds = with_round(rounds, row("air_drag", "stribeck"))
    assert [one["effects"] for one in rounds] == [[], ["air_drag"], ["air_drag", "stribeck"]]
    assert [one["effects"] for one in with_round(rounds, row("air_drag"))] == [[], ["air_drag"]]
    assert [one["effects"] for one in with_round(rounds, row("stribeck"))] == [[], ["stribeck"]]
    assert with_round(rounds, row()) == [row()]


def test_a_track_grows_frame_by_frame_and_is_replaced_when_it_is_done():
    shown = with_partial(Results({}), {"tracking": {"clip": "a", "objects": ["b"], "fps": 10.0}})
    for index, place in enumerate(((1.0, 2.0), None, (3.0, 4.0))):
        frame = {"index": index, "places_px": {"b": place}}
        shown = with_partial(shown, {"frame": frame})
    assert with_partial(shown, {"frame": frame}) == shown, "no frame counts twice"
    track = shown.tracks["a"]
    assert track["seen_px"] == [[[1.0, 2.0], [None, None], [3.0, 4.0]]]
    assert track["times"] == [0.0, 0.1, 0.2] and track["is_running"]
    done = {"clip": "a", "times": [0.0]}
    assert with_partial(shown, {"track": done}).tracks == {"a": done}


def test_candidates_come_with_their_curves_and_stand_in_their_order():
    shown = Results({})
    for name, score in (("a", 1.0), ("b", 3.0), ("a", 4.0)):
        row = {"effect": name, "score": score}
        shown = with_partial(shown, {"candidate": row, "curves": [score]})
    assert [(one["effect"], one["score"]) for one in shown.candidates] == [("a", 4.0), ("b", 3.0)]
    assert shown.previews == {"a": [4.0], "b": [3.0]}


def test_the_staircase_has_a_step_for_each_round_and_says_how_k1_moved():
    drawn = stairs([row(), row("air_drag", rmse=0.002)])
    assert "0.0100 m/s" in drawn and "0.0020 m/s" in drawn and "+ air_drag" in drawn
    assert friction_moves([row(), row("air_drag")]) == ["k1 0.1000 ± 0.0010  ↓ 0.0500 (from 0.15)"]
    assert "&lt;b&gt;" in stairs([row(), row("<b>")]), "names are text"


def test_a_round_is_read_from_result_json():
    entry = {"mean": 0.1, "sd": 0.01, "q025": 0.08}
    error = {"rmse": 1.0, "noise": 0.5, "chi2_per_dof": 3.0, "l1": 0.0}
    found = round_of({"effects": ["a"], "error": error, "parameters": {"k1": entry, "m1": entry}})
    assert found == {
        "effects": ["a"], "rmse": 1.0, "noise": 0.5, "chi2_per_dof": 3.0,
        "k1": {"mean": 0.1, "sd": 0.01},
    }  # fmt: skip


def test_a_pixel_track_is_read_back_with_its_gaps(tmp_path):
    path = tmp_path / "track_px.csv"
    path.write_text(
        "time_s,object1_x_px,object1_y_px,object1_sd_x_px,object1_sd_y_px,object1_angle_deg\n"
        "0,1.5,2.5,0.1,0.2,0\n0.1,,,,,\n"
    )
    found = pixel_track(path)
    assert found is not None
    assert found["objects"] == ["object1"] and found["times"] == [0.0, 0.1]
    assert found["seen_px"] == [[[1.5, 2.5], [None, None]]]
    assert found["sd_px"][0][0] == [0.1, 0.2]


@pytest.mark.parametrize("text", ["", "time_s\n", "time_s,object1_x_px\nx,1\n", "\0"])
def test_a_damaged_track_is_none(tmp_path, text):
    path = tmp_path / "track_px.csv"
    path.write_text(text)
    assert pixel_track(path) in (None, {**(pixel_track(path) or {}), "objects": []})


def test_what_falls_is_drawn_along_y():
    assert charts.fit_figure(MOTION, False)["layout"]["yaxis"]["title"]["text"] == "x, m"
    fallen = {**MOTION, "model_y": [[0.0, -0.2, -0.8]]}
    assert charts.fit_figure(fallen, False)["layout"]["yaxis"]["title"]["text"] == "y, m"


def test_figures_are_plain_data_that_a_page_can_take():
    stretch = {"start": 0.0, "end": 0.1}
    extra = ("air_drag", {"times": [0.0], "model_x": [[0.0]], "white": [[0.1]]})
    for dark in (False, True):
        for figure in (
            charts.fit_figure(MOTION, dark),
            charts.residual_figure(MOTION, [stretch], dark, extra),
        ):
            assert json.loads(json.dumps(figure)) == figure
    shaded = charts.residual_figure(MOTION, [stretch], False)["layout"]["shapes"]
    assert [(one["x0"], one["x1"]) for one in shaded if one["type"] == "rect"] == [(0.0, 0.1)]


def test_a_missing_force_is_drawn_of_all_objects_in_one_figure_in_the_colours_of_the_page():
    known, unknown = [0.1, None, 0.3], [None, None, None]
    keys = ("acceleration_m_s2", "sd_m_s2", "path_m", "speed_m_s")
    objects = {"ball": dict.fromkeys(keys, known), "wall": dict.fromkeys(keys, unknown)}
    record = {"time_s": [0.0, 0.1, 0.2], "objects": objects}
    light, dark = (charts.missing_figure(record, is_dark) for is_dark in (False, True))
    assert {one["xaxis"] for one in light["data"]} == {"x", "x2", "x3"}
    assert {one["name"] for one in light["data"]} == {"95 %", "missing"}, "of one object"
    assert json.loads(json.dumps(light)) == light
    inks = [one["layout"]["template"]["layout"]["font"]["color"] for one in (light, dark)]
    assert inks == ["rgba(35,37,43,1)", "rgba(232,229,223,1)"]


def test_a_prediction_has_the_clips_end():
    keys = ("time_s", "x_m", "x_q025_m", "x_q975_m")
    found = {"objects": {"ball": dict.fromkeys(keys, (0.0, 1.0))}, "clip_end": 0.5}
    (end,) = charts.prediction_figure(found, True)["layout"]["shapes"]
    assert (end["x0"], end["x1"]) == (0.5, 0.5)


@pytest.mark.video
def test_trials_are_chosen_and_named_as_the_commands_name_them(tmp_path):
    clip_in(tmp_path)
    clip_in(tmp_path, "again")
    session = Session(tmp_path, "slide")
    assert session.active == "slide" and session.trials.name == "slide"
    session.choose(("slide", "again"))
    assert session.trials.name == "again+slide" and session.trials.files == [
        "again.mp4", "slide.mp4",
    ]  # fmt: skip
    assert session.trials.run == tmp_path / "runs" / "again+slide"
    assert session.states["track"] == "open" and session.states["fit"] == "locked"
    session.choose(())
    assert session.chosen == ("again", "slide"), "there is always one"


@pytest.mark.video
def test_of_a_large_folder_a_clip_is_opened_when_it_is_turned_to(tmp_path, monkeypatch):
    monkeypatch.setattr("galileo_jax.studio.clips.MOST_AT_ONCE", 1)
    for name in ("a", "b", "c"):
        clip_in(tmp_path, name)
    (tmp_path / "b.mp4").write_bytes(b"no video")
    session = Session(tmp_path)
    assert list(session.sheets) == ["a"] and session.names == ("a", "b", "c")
    session.show("c")
    assert session.active == "c"
    session.show("b")
    assert session.active == "c" and "cannot be decoded" in session.broken["b"]
