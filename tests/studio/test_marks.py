import json
import math
from dataclasses import asdict, replace

import pytest

import galileo_jax as gx
from galileo_jax.runtime.errors import InputError
from galileo_jax.studio.check import remarks_on
from galileo_jax.studio.clip_state import (
    History,
    Sheet,
    Step,
    changed,
    opened,
    redone,
    stored,
    undone,
)
from galileo_jax.studio.marks import (
    CORNERS,
    Marks,
    ObjectMark,
    corrected,
    handles,
    moved,
    with_object,
    with_rectangle,
    without_object,
)
from galileo_jax.studio.marks_yaml import blank, declared, labels, proposed
from galileo_jax.studio.stages import Trials, made, states, track_files, track_mark
from galileo_jax.studio.store import FILE, Store
from tests.studio.clips import clip_in

MARKS = Marks(
    objects=(ObjectMark("object1", (50.0, 40.0)), ObjectMark("object2", (200.0, 90.0))),
    upper=(30.0, 50.0), foot=(130.0, 100.0), stick=((10.0, 170.0), (110.0, 170.0)), stick_m=0.2,
)  # fmt: skip


def after_json(marks: Marks) -> Marks | None:
    """As they come back from the studio's file."""
    kept = stored(json.loads(json.dumps(asdict(History(Step(marks, ""))))))
    return None if kept is None else kept.present.marks


def film_of(root, video, store) -> Sheet:
    sheet = opened(root, video, store)
    assert isinstance(sheet, Sheet)
    return sheet


def apart(one, other) -> float:
    return math.dist(one, other)


def test_the_foot_takes_the_ramp_with_it_and_the_upper_end_turns_it():
    after = moved(MARKS, "foot", (140.0, 110.0))
    assert after.upper == (40.0, 60.0)
    assert "ramp" not in labels(MARKS, after), "a measured angle must not be drawn afresh"
    assert labels(MARKS, after)["origin"] == (140.0, 110.0)
    assert labels(MARKS, moved(MARKS, "upper", (30.0, 40.0))) == {
        "ramp": (30.0, 40.0, 130.0, 100.0)
    }


def test_only_what_was_changed_is_declared():
    assert labels(MARKS, MARKS) == {}
    assert labels(MARKS, moved(MARKS, "object2", (201.0, 91.0))) == {
        "point": {"object2": (201.0, 91.0)}
    }
    assert labels(MARKS, replace(MARKS, stick_m=0.4))["scale"] == (10.0, 170.0, 110.0, 170.0, 0.4)
    assert labels(MARKS, replace(MARKS, first_frame=3))["first_frame"] == {
        "object1": 3, "object2": 3,
    }  # fmt: skip


def test_the_frames_that_count_and_corrections_are_declared():
    ends = labels(MARKS, replace(MARKS, last_frame=30))
    assert ends == {"last_frame": {"object1": 30, "object2": 30}}
    right = corrected(MARKS, "object2", 12, (201.0, 91.004))
    assert labels(MARKS, right) == {"correct": {"object2": [(12, 201.0, 91.0)]}}
    again = corrected(right, "object2", 12, (203.0, 91.0))
    assert labels(right, again) == {"correct": {"object2": [(12, 203.0, 91.0)]}}
    assert corrected(again, "object2", 12, None) == MARKS
    assert labels(again, MARKS) == {"correct": {"object2": [(12,)]}}
    assert after_json(again) == again


def test_a_rectangle_of_known_sides_takes_the_sticks_place():
    laid = with_rectangle(MARKS, (320, 180))
    assert [name for name in handles(laid) if name not in handles(MARKS)] == list(CORNERS)
    assert not {"stick1", "stick2"} & set(handles(laid))
    assert labels(MARKS, laid) == {}, "without lengths it says nothing"
    assert [one.kind for one in remarks_on(laid, 240.0, None)].count("missing") == 1
    typed = replace(laid, rectangle_m=(0.5, 0.25))
    assert not [one for one in remarks_on(typed, 240.0, None) if one.kind == "missing"]
    corners = (96.0, 126.0, 224.0, 126.0, 224.0, 54.0, 96.0, 54.0)
    assert labels(MARKS, typed) == {"rectangle": (*corners, 0.5, 0.25)}
    dragged = moved(typed, "corner3", (230.0, 50.0))
    assert labels(typed, dragged)["rectangle"][4:6] == (230.0, 50.0)
    assert after_json(dragged) == dragged
    crossed = moved(typed, "corner3", (90.0, 150.0))
    assert any("crossed" in one.sentence for one in remarks_on(crossed, 240.0, None))
    assert "scale" in labels(typed, replace(typed, rectangle=None)), "and back to the stick"


def test_a_rectangle_in_a_yaml_is_drawn():
    content = {
        "scenario": "ramp", "objects": [], "ramp_angle_deg": 20.0,
        "rectangle": {"corners_px": [[1, 9], [8, 9], [8, 2], [1, 2]], "sides_m": [0.4, 0.4]},
    }  # fmt: skip
    found = declared(content, (320, 180), 30.0)
    assert found.rectangle == ((1, 9), (8, 9), (8, 2), (1, 2)) and found.rectangle_m == (0.4, 0.4)
    assert found.has_scale


def test_marks_survive_json_and_everything_in_them_can_be_grabbed():
    assert after_json(MARKS) == MARKS
    assert set(handles(MARKS)) == {"object1", "object2", "upper", "foot", "stick1", "stick2"}
    more = with_object(MARKS, (5.0, 6.0))
    assert handles(more)["object3"] == (5.0, 6.0)
    assert without_object(more, "object3") == MARKS


def test_check_says_what_is_missing_and_what_is_odd():
    nothing = [one.kind for one in remarks_on(MARKS, 240.0, None)]
    assert nothing == ["odd"], "a ramp line of 112 px"
    unknown = remarks_on(replace(MARKS, stick_m=None), 240.0, None)
    assert [one.kind for one in unknown if "scale" in one.sentence] == ["missing"]
    assert any("slow-motion" in one.sentence for one in remarks_on(MARKS, 30.0, None))
    assert remarks_on(replace(MARKS, objects=()), 240.0, None)[0].kind == "missing"


@pytest.mark.video
def test_each_step_is_on_disk_and_can_be_undone_to_the_letter(tmp_path):
    video = clip_in(tmp_path)
    text = video.with_suffix(".yaml").read_text()
    store = Store(tmp_path)
    sheet = film_of(tmp_path, video, store)
    assert sheet.is_complete
    x, y = sheet.marks.objects[0].point or (0.0, 0.0)
    sheet = changed(sheet, moved(sheet.marks, "object1", (x + 1, y)), store)
    assert gx.load(video).objects[0].point_px == (x + 1, y)
    assert film_of(tmp_path, video, Store(tmp_path)) == sheet, "a new server sees the same"
    sheet = undone(film_of(tmp_path, video, Store(tmp_path)), store)
    assert video.with_suffix(".yaml").read_text() == text
    sheet = redone(sheet, store)
    assert gx.load(video).objects[0].point_px == (x + 1, y)


@pytest.mark.video
def test_marks_that_cannot_be_are_kept_and_explained_but_not_written(tmp_path):
    video = clip_in(tmp_path)
    text = video.with_suffix(".yaml").read_text()
    store = Store(tmp_path)
    sheet = film_of(tmp_path, video, store)
    good = sheet.marks
    sheet = changed(sheet, moved(good, "foot", (150.0, 20.0)), store)
    assert video.with_suffix(".yaml").read_text() == text
    assert not sheet.is_complete
    assert "inside" in (sheet.history.present.problem or "")
    again = film_of(tmp_path, video, Store(tmp_path))
    assert again.marks == sheet.marks, "what was drawn is not lost"
    mended = changed(again, good, store)
    assert mended.history.present.problem is None and mended.is_complete


@pytest.mark.video
def test_an_edit_by_another_program_is_taken_over(tmp_path):
    video = clip_in(tmp_path)
    store = Store(tmp_path)
    sheet = film_of(tmp_path, video, store)
    changed(sheet, moved(sheet.marks, "object1", (50.0, 50.0)), store)
    gx.label(video, fps=60.0)
    again = film_of(tmp_path, video, Store(tmp_path))
    assert again.marks.fps == 60.0
    assert math.isclose(undone(again, store).marks.fps, sheet.marks.fps)


@pytest.mark.video
def test_an_object_can_be_taken_out_again(tmp_path):
    video = clip_in(tmp_path)
    store = Store(tmp_path)
    sheet = film_of(tmp_path, video, store)
    sheet = changed(sheet, without_object(sheet.marks, "object2"), store)
    assert [one.name for one in gx.load(video).objects] == ["object1"]


@pytest.mark.video
def test_what_depends_on_a_change_is_stale_and_nothing_else(tmp_path):
    video = clip_in(tmp_path)
    store = Store(tmp_path)
    sheet = film_of(tmp_path, video, store)
    folder = track_files(sheet)
    folder.mkdir()
    (folder / "track_px.csv").write_text("time_s\n")
    store.put("clips", "slide", {"tracked": made(folder / "track_px.csv", track_mark(sheet))})
    trials = Trials(tmp_path, (sheet,))
    run = trials.run
    run.mkdir(parents=True)
    (run / "result.json").write_text("{}")
    store.put("runs", "slide", {"fit": made(run / "result.json", trials.made_of())})
    found = states(trials, store, ())
    assert (found["track"], found["fit"], found["compare"]) == ("done", "done", "open")
    x, y = sheet.marks.objects[0].point or (0.0, 0.0)
    after = changed(sheet, moved(sheet.marks, "object1", (x + 1, y)), store)
    found = states(Trials(tmp_path, (after,)), store, ())
    assert (found["marks"], found["track"], found["fit"]) == ("done", "stale", "stale")
    back = undone(after, store)
    assert states(Trials(tmp_path, (back,)), store, ())["fit"] == "done"


@pytest.mark.video
def test_a_bare_video_gets_a_proposal_that_lacks_only_the_scale(tmp_path):
    video = clip_in(tmp_path, is_bare=True)
    store = Store(tmp_path)
    sheet = film_of(tmp_path, video, store)
    assert not sheet.is_drawn and not sheet.is_complete
    truth = gx.load(clip_in(tmp_path, "known"))
    sheet = changed(sheet, proposed(asdict(gx.propose(video)), sheet.info.size_px), store)
    for one, known in zip(sheet.marks.objects, truth.objects, strict=True):
        assert apart(one.point, known.point_px) < 4.0
    assert apart(sheet.marks.foot, truth.origin_px) < 8.0
    assert [one.kind for one in sheet.remarks].count("missing") == 1
    assert gx.load(video).ramp_angle_deg == pytest.approx(truth.ramp_angle_deg, abs=1.0)


def test_nothing_is_proposed_where_nothing_moves(tmp_path):
    import cv2
    import numpy as np

    path = tmp_path / "still.mp4"
    writer = cv2.VideoWriter(str(path), cv2.VideoWriter.fourcc(*"mp4v"), 30.0, (64, 48))
    for _ in range(6):
        writer.write(np.full((48, 64, 3), 90, np.uint8))
    writer.release()
    with pytest.raises(InputError, match="nothing moves"):
        gx.propose(path)


@pytest.mark.parametrize("content", ["", "[]", '{"clips": 3}', '{"clips": {"slide": [1]}}'])
def test_a_damaged_file_costs_undo_and_nothing_else(tmp_path, content):
    (tmp_path / FILE).write_text(content)
    store = Store(tmp_path)
    assert store.get("clips", "slide") == {}
    store.put("clips", "slide", {"present": 1})
    assert Store(tmp_path).get("clips", "slide") == {"present": 1}


def test_blank_marks_can_be_dragged():
    assert set(handles(blank(30.0, (640, 360)))) == {"upper", "foot", "stick1", "stick2"}
