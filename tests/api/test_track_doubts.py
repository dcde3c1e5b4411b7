"""What a fit says of the tracks and marks that it rests on."""

import json
import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import galileo_jax as gx
from galileo_jax.api.track_doubts import (
    FAR,
    as_if_rolling,
    as_in_slow_motion,
    taken_as_exact,
    with_track_doubts,
)
from galileo_jax.clip.schema import Clip, ClipObject
from galileo_jax.commands import command
from galileo_jax.commands import fit as fit_command
from galileo_jax.measurement.measure import Measurement
from galileo_jax.measurement.segments.segments import Segments
from galileo_jax.measurement.segments.track_failure import Astray
from galileo_jax.observation.observation import Observation

ANGLE_DEG, SCALE = 20.0, 500.0
WAY_M = 0.4


@pytest.fixture
def measured() -> Measurement:
    """An object that goes 0.4 m down a ramp of 20 degrees, 200 px."""
    times = np.linspace(0, 1, 31)
    angle = math.radians(ANGLE_DEG)
    place = (times**2 * WAY_M) * np.array([[math.cos(angle)], [-math.sin(angle)]])
    seen = Observation(
        ("object1",),
        times,
        place[None],
        np.full((1, 2, 2, 31), 1e-8),
        np.ones((1, 31), bool),
    )
    clip = Clip(
        path=Path("clip.yaml"),
        video=Path("clip.mp4"),
        source="clip.mp4",
        scenario="incline",
        fps=30.0,
        frame_count=31,
        ramp_angle_deg=ANGLE_DEG,
        pixels_per_metre=SCALE,
        objects=(ClipObject(name="object1", shape="box"),),
    )
    return Measurement(clip, seen, seen)


def declared(measured: Measurement, **values: object) -> Measurement:
    return replace(measured, clip=measured.clip.model_copy(update=values))


@pytest.mark.parametrize(("inertia", "what"), [(0.4, "a ball"), (0.5, "a cylinder")])
def test_a_box_as_fast_as_what_rolls_may_be_that(measured, inertia: float, what: str) -> None:
    """Of the acceleration g sin a / (1 + inertia) the friction is that of the box."""
    angle = math.radians(ANGLE_DEG)
    k1 = (math.sin(angle) - math.sin(angle) / (1 + inertia)) / math.cos(angle)
    assert f"{what} that rolls" in (as_if_rolling(measured, k1) or "")
    assert as_if_rolling(measured, 1.05 * k1) is None
    ball = declared(measured, objects=(ClipObject(name="object1", shape="sphere"),))
    assert as_if_rolling(ball, k1) is None


@pytest.mark.parametrize("times", [4, 8])
def test_what_hardly_speeds_up_may_be_in_slow_motion(measured, times: int) -> None:
    """With true friction .2, and times that are too long."""
    tangent = math.tan(math.radians(ANGLE_DEG))
    k1 = tangent - (tangent - 0.2) / times**2
    assert "as in slow motion" in (as_in_slow_motion(measured, k1) or "")
    assert as_in_slow_motion(measured, 0.2) is None


def test_half_a_pixel_changes_k1_as_a_steeper_ramp_and_longer_lengths_would(measured) -> None:
    """Of the same acceleration, by the law of motion itself."""
    k1, gravity = 0.1, 9.81
    angle = math.radians(ANGLE_DEG)
    acceleration = gravity * (math.sin(angle) - k1 * math.cos(angle))

    def friction(angle: float, acceleration: float) -> float:
        return math.tan(angle) - acceleration / (gravity * math.cos(angle))

    off = math.sqrt(2) * 0.5 / (WAY_M * SCALE)
    steeper = friction(angle + off, acceleration) - k1
    longer = k1 - friction(angle, acceleration * (1 + off))
    text = taken_as_exact(measured, k1)
    assert text is not None
    assert f"(200 px) would change k1 by {steeper:.2g} and {longer:.2g}:" in text
    taken = "ramp_angle_deg as exact and pixels_per_metre as known to a thousandth"
    assert f"the fit takes {taken}. If they were read off" in text
    assert "declare ramp_angle_sd_deg and pixels_per_metre_sd" in text


def test_what_has_an_uncertainty_is_not_taken_as_exact(measured) -> None:
    text = taken_as_exact(declared(measured, ramp_angle_sd_deg=0.1), 0.1)
    assert text is not None and "angle" not in text
    for scale_sd in (0.0, 1.0):
        both = declared(measured, ramp_angle_sd_deg=0.1, pixels_per_metre_sd=scale_sd)
        assert taken_as_exact(both, 0.1) is None


def test_a_track_without_a_video_has_no_marks(measured) -> None:
    assert taken_as_exact(declared(measured, video=None), 0.1) is None


def result(chi2: float) -> dict:
    return {"status": "the fit converged", "error": {"chi2_per_dof": chi2}}


def test_a_good_fit_is_left_alone(measured) -> None:
    assert with_track_doubts([measured], result(1.1)) == result(1.1)
    assert with_track_doubts([measured], result(0.9 * FAR)) == result(0.9 * FAR)


def test_a_fit_of_a_lost_object_says_so(measured) -> None:
    lost = replace(measured, segments=Segments(astray=(Astray("object1", 0.634, "it leaps"),)))
    found = with_track_doubts([lost], result(1.1))
    assert found["status"] == "the fit converged; but object1 is lost from 0.63 s on"


def test_a_fit_far_from_its_track_says_so_whatever_its_errors_are(measured) -> None:
    def off(percent: float) -> dict:
        return {"status": "", "error": {"chi2_per_dof": 1.1, "rms_percent_of_way": percent}}

    assert with_track_doubts([measured], off(2.0)) == off(2.0)
    found = with_track_doubts([measured], off(11.0))
    assert "stays 11 % of the way moved from the track" in found["status"]
    assert "check that the track follows the objects" in found["warnings"][0]


def test_chi2_in_the_thousands_sends_to_the_overlay(measured) -> None:
    mask = measured.observation.mask.copy()
    mask[0, 6:18] = False
    hidden = replace(measured, observation=replace(measured.observation, mask=mask))
    found = with_track_doubts([hidden], result(5303.4))
    assert found["status"] == (
        "the fit converged; but no motion of this model comes close to the track (chi2 5303)"
    )
    (warning,) = found["warnings"]
    assert "above all object1 from 0.60 s on: it had not been seen for 0.40 s" in warning
    assert warning.endswith("galileo track clip.mp4")


def test_the_run_says_what_is_taken_as_exact(tmp_path: Path, capsys) -> None:
    """In result.json, in the page and in what the command prints."""
    gx.simulate(tmp_path / "clip.mp4", seed=71)
    out = tmp_path / "run"
    assert command.run(fit_command.main, [str(tmp_path / "clip.mp4"), "--out", str(out)]) == 0
    (told,) = json.loads((out / "result.json").read_text())["taken_as_exact"]
    assert "the fit takes ramp_angle_deg as exact. If it was read off" in told
    assert f"note: {told}" in capsys.readouterr().err
    assert "ramp_angle_deg as exact" in (out / "report.html").read_text()
