"""A sweep's table of clips: what each row says, and its picture."""

from pathlib import Path

import cv2
import numpy as np
import pytest

from galileo_jax.clip.load import load_clip
from galileo_jax.observation.observation import Observation
from galileo_jax.report.sweep_clips import (
    PICTURE_PX,
    ClipRow,
    clips_section,
    middle_frame,
    thumbnail,
)
from tests.clip.broken_clips import build_good
from tests.video.make_video import SIZE_PX

ENTRY = {"mean": 0.25, "sd": 0.02, "q025": 0.21, "q975": 0.29, "unit": "1", "identified": True}
UNKNOWN = {**ENTRY, "identified": False}


def fit_of(chi2: float | None = 1.0, **more):
    parameters = {"m1": UNKNOWN, "k1": ENTRY, "k2": UNKNOWN}
    derived = {"mass_ratio": {**ENTRY, "mean": 2.0, "sd": 0.1, "q975": 2.2}, "phi": ENTRY}
    error = {"chi2_per_dof": chi2, "explained_by_noise": chi2 is not None and chi2 < 3}
    return {"parameters": parameters, "derived": derived, "error": error, **more}


def diagnosis_of(status, effects=()):
    last = {"effects": [], "k1": ENTRY, "chi2_per_dof": 1.2, "rmse": 0.1}
    return {"verdict": {"status": status, "effects": list(effects)}, "history": [last]}


def observation_of(x_m, mask=None):
    """One object that moves along x."""
    x_m = np.asarray(x_m, float)
    mask = np.ones((1, len(x_m)), bool) if mask is None else np.asarray([mask])
    position = np.stack([x_m, 0 * x_m])[None]
    covariance = np.zeros((1, 2, 2, len(x_m)))
    return Observation(("object1",), np.arange(len(x_m)) / 30, position, covariance, mask)


def test_values_and_what_is_not_determined():
    text = clips_section(
        [ClipRow("a", fit=fit_of(), pages=(("report", Path("cells/a b/r.html")),))]
    )
    assert 'data-label="k1">0.250 <span class="soft">0.210 to 0.290<' in text
    assert 'data-label="k2"><span class="soft">not determined</span>' in text
    assert 'data-label="m1/m2">2.00 <span class="soft">0.21 to 2.20<' in text
    assert ">m1<" not in text and ">phi<" not in text
    assert '<a href="cells/a%20b/r.html">report</a>' in text


def test_objects_that_are_not_there_have_no_column():
    alone = fit_of()
    alone["parameters"], alone["derived"] = {"k1": ENTRY}, {}
    text = clips_section([ClipRow("a", fit=alone)])
    assert "k2" not in text and "m1/m2" not in text
    both = clips_section([ClipRow("a", fit=alone), ClipRow("b", fit=fit_of())])
    assert 'data-label="k2"></td>' in both, "an empty cell beside another clip's value"


def test_a_motion_without_friction_shows_what_it_determines():
    flight = fit_of()
    flight["derived"] = {}
    speed = {**ENTRY, "mean": 3.5, "unit": "m/s"}
    flight["parameters"] = {"m1": UNKNOWN, "start_speed": speed, "start_angle": UNKNOWN}
    text = clips_section([ClipRow("a", fit=flight)])
    assert 'data-label="start_speed">3.500 m/s <span class="soft">' in text
    assert "start_angle" not in text and "start_speed: speed at the start" in text


def test_a_point_estimate_has_no_standard_deviation():
    best = {"m1": 0.3, "k1": 0.2, "m2": 0.1, "k2": 0.4}
    text = clips_section([ClipRow("a", fit=fit_of(best=best))])
    assert 'data-label="k1">0.2<' in text and 'data-label="m1/m2">3<' in text
    assert " to " not in text


@pytest.mark.parametrize(
    ("row", "said", "is_good"),
    [
        ({"fit": fit_of()}, "fits", True),
        ({"fit": fit_of(9.0)}, "does not fit", False),
        ({"fit": fit_of(None)}, "does not fit", False),
        ({"diagnosis": diagnosis_of("none")}, "none", True),
        ({"diagnosis": diagnosis_of("named", ["air_drag"])}, "air_drag", True),
        ({"diagnosis": diagnosis_of("named", ["a", "b"])}, "a and b", True),
        ({"diagnosis": diagnosis_of("ambiguous", ["a", "b"])}, "ambiguous: a, b", False),
        ({"diagnosis": diagnosis_of("unknown")}, "something unknown", False),
        ({"fit": fit_of(), "diagnosis": diagnosis_of("none")}, "none", True),
    ],
)
def test_whether_the_model_describes_the_clip(row, said, is_good):
    mark = "" if is_good else ' class="warn"'
    assert f"<b{mark}>{said}</b>" in clips_section([ClipRow("a", **row)])


def test_an_explained_clip_names_its_effect_how_near_it_comes_and_why_it_stands_apart():
    fit = fit_of()
    fit["error"] |= {"rms_mm": 0.271, "rms_percent_of_way": 0.0512}
    check = {"adequate": True}
    rows = [ClipRow("a", fit=fit, check=check)]
    rows.append(ClipRow("b", fit=fit, check={"adequate": None}, remark="<why>", outside=("k1",)))
    text = clips_section(rows)
    assert "<b>none</b>" in text and '<b class="warn">no verdict</b>' in text
    assert 'data-label="off">0.27 mm <span class="soft">0.051 % of the way<' in text
    assert text.count("◆") == 1 and text.index("◆") > text.index(">a</th>")
    assert text.count('class="value outside" data-label="k1"') == 1
    assert '<td class="remark">&lt;why&gt;</td>' in text
    assert "remark" not in clips_section(rows[:1]), "no column where there is nothing to say"


def test_a_clip_that_failed_says_why():
    text = clips_section([ClipRow("a", failures=("a.yaml: fps: <0>",) * 2), ClipRow("b")])
    assert text.count("a.yaml: fps: &lt;0&gt;") == 1
    assert "Not computed yet." in text


def test_trials_and_other_fits_are_named():
    text = clips_section([ClipRow("a", ("b & c",), fit=fit_of(), other_fits=2)])
    assert "fitted together with b &amp; c" in text
    assert "first fit of each clip, in the order of the config" in text


def test_the_middle_of_a_motion():
    assert middle_frame(observation_of([0, 0, 0, 0, 1, 2, 3, 4, 4, 4])) == 5
    assert middle_frame(observation_of(np.zeros(9))) == 4
    mask = [False, True, True, False, False, True]
    assert middle_frame(observation_of([9, 0, 0, 9, 9, 4], mask)) == 4, "where it must have been"


def test_a_track_has_a_drawing_to_scale():
    row = ClipRow("a", observation=observation_of([0, 1, 2]), fit=fit_of())
    text = clips_section([row])
    assert '<polyline points="6.0,31.0 50.0,31.0 94.0,31.0"' in text
    nothing = observation_of([0, 1], [False, False])
    assert "<svg" not in clips_section([ClipRow("a", observation=nothing, fit=fit_of())])


@pytest.mark.video
def test_a_video_has_a_small_picture(tmp_path):
    clip = load_clip(build_good(tmp_path))
    picture = thumbnail(clip, observation_of(np.arange(clip.frame_count)))
    assert picture is not None
    decoded = cv2.imdecode(np.frombuffer(picture, np.uint8), cv2.IMREAD_COLOR)
    assert decoded is not None
    height, width = decoded.shape[:2]
    assert max(height, width) == min(PICTURE_PX, max(SIZE_PX))
    text = clips_section([ClipRow("a", picture=picture, fit=fit_of())])
    assert '<img alt="a frame of a" src="data:image/jpeg;base64,' in text
    assert thumbnail(clip.model_copy(update={"video": None}), observation_of([0, 1])) is None
    lost = clip.model_copy(update={"video": tmp_path / "lost.mp4"})
    assert thumbnail(lost, observation_of([0, 1])) is None
