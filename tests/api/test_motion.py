"""A model's motion beside the measured; proposals for a bare video."""

import math
from dataclasses import replace

import numpy as np
import pytest

import galileo_jax as gx

NOISE = 1.5  # the root mean square of residuals that are noise, at most


@pytest.fixture(scope="module")
def video(tmp_path_factory):
    path = tmp_path_factory.mktemp("motion") / "clip.mp4"
    gx.simulate(path, seed=7, size=(480, 270), seconds=1.6)
    return path


@pytest.fixture(scope="module")
def fit(video):
    return gx.fit(video)


@pytest.mark.video
def test_the_best_fit_misses_the_points_by_the_noise(fit):
    (motion,) = fit.motions()
    assert motion.misfit < NOISE
    assert np.nanmax(np.abs(motion.measured_m - motion.predicted_m)) < 0.003
    for name in ("x_white", "y_white"):
        axis = "xy".index(name[0])
        table = fit.residuals.pivot(index="time_s", columns="object", values=name).to_numpy()
        np.testing.assert_allclose(motion.residuals[:, axis].T, table, atol=1e-9)


@pytest.mark.video
def test_other_values_move_the_model_from_where_it_starts(fit):
    best, values = fit.parameters["k1"]["mean"], fit.motions()[0]
    (moved,) = fit.motions({"k1": best + 0.05})
    np.testing.assert_allclose(moved.predicted_m[0, :, 0], values.predicted_m[0, :, 0], atol=2e-4)
    assert moved.predicted_m[0, 0, 20] < values.predicted_m[0, 0, 20] - 0.01
    assert moved.misfit > 5 * values.misfit
    with pytest.raises(gx.InputError, match="k7: no parameter of this model; known: m1, k1"):
        fit.motions({"k7": 1.0})


@pytest.mark.video
def test_the_picture_shows_it_where_the_video_does(video, fit):
    (motion,) = fit.motions()
    pixels = gx.track(video).pixels
    assert motion.measured_px is not None and motion.predicted_px is not None
    assert pixels is not None
    np.testing.assert_allclose(motion.measured_px, pixels.position_px, atol=1e-6)
    assert np.nanmax(np.abs(motion.predicted_px - motion.measured_px)) < 1.5
    clip = gx.load(video)
    assert clip.pixels_per_metre is not None and clip.objects[0].size_m is not None
    length = np.ptp(motion.outlines_px[0][:, 0])
    assert length == pytest.approx(clip.objects[0].size_m[0] * clip.pixels_per_metre)
    assert math.degrees(motion.turned_rad[0, 0]) == pytest.approx(clip.ramp_angle_deg, abs=0.1)
    assert motion.turned_rad[1, 0] == 0.0


@pytest.mark.video
@pytest.mark.parametrize("direction", ["right", "left"])
def test_a_proposal_has_the_objects_the_ramp_and_its_foot(tmp_path, direction):
    path = tmp_path / "clip.mp4"
    gx.simulate(path, seed=8, size=(480, 270), seconds=1.5, direction=direction)
    truth = gx.load(path)
    found = gx.propose(path)
    assert (found.scenario, found.direction, found.fps) == ("ramp", direction, 30.0)
    assert truth.origin_px is not None and found.foot is not None and found.ramp is not None
    assert math.dist(found.foot, truth.origin_px) < 4.0
    for item in truth.objects:
        assert item.point_px is not None
        assert (
            math.dist(found.objects[item.name], item.point_px) < 5.0
        )  # features on one side may miss
    x1, y1, x2, y2 = found.ramp
    angle = math.degrees(math.atan2(y2 - y1, abs(x2 - x1)))
    assert angle == pytest.approx(truth.ramp_angle_deg, abs=0.5)
    assert replace(found, doubts=()) == found, "nothing is in doubt"
