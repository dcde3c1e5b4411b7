import json
from dataclasses import replace

import cv2
import numpy as np
import pytest

from galileo_jax.api.simulate import simulate
from galileo_jax.clip.load import load_clip
from galileo_jax.clip.track_csv import read_observation_csv
from galileo_jax.simulation.motion import roll_out
from galileo_jax.simulation.truth import SLOWEST_HIT_M_S, Truth, draw_truth
from tests.reference_ramp import Experiment, Solution, solve

# The motion is exact at the records; an event is looked for on straight lines between them.
EXACT_M = 1e-9
BETWEEN_RECORDS_S = 1e-4
# Faces give way by 0.5 mm, and boxes rock on their edges for some hundredths of a second.
FREE_ATOL_M, FREE_TIPPED_RAD = 0.001, 0.03
FREE = ("--track-only", "--motion", "free")

# What readers of truth files (../shared/data, benchmarks) rely on.
TRUTH_KEYS = {"name", "engine", "effect", "effect_parameters", "m1", "k1", "m2", "k2", "gravity"}
TRUTH_KEYS |= {"ramp_angle_deg_true", "ramp_angle_deg_declared", "release_m", "object2_y_m"}
TRUTH_KEYS |= {"size1_m", "size2_m", "events_s", "trajectory", "frames", "fps_true"}
TRUTH_KEYS |= {"fps_declared", "pixels_per_metre_true", "pixels_per_metre_declared"}
TRUTH_KEYS |= {"world_to_image", "image_px", "noise_grey_levels", "flicker", "exposure_s", "hand"}


def reference(truth: Truth, times_s: np.ndarray) -> Solution:
    (size1, size2) = ((item.size_m[0], item.size_m[2]) for item in truth.objects if item.size_m)
    experiment = Experiment(
        (truth.mass_kg[0], truth.mass_kg[1]),
        (truth.friction[0], truth.friction[1]),
        truth.angle_rad,
        (size1, size2),
        truth.release_m,
        truth.stand_x_m[0],
        truth.gravity,
    )
    return solve(experiment, times_s)


@pytest.mark.parametrize("seed", range(4))
def test_motion_is_that_of_points_with_friction(seed):
    truth = draw_truth(np.random.default_rng(seed), (10.0, 20.0)[seed % 2], {})
    motion = roll_out(truth)
    exact = reference(truth, motion.times_s)
    assert truth.hit_speed_m_s > SLOWEST_HIT_M_S
    assert motion.position_m == pytest.approx(exact.position_m, abs=EXACT_M)
    events = motion.events_s(truth)
    assert events["foot"] == pytest.approx(exact.foot_s, abs=BETWEEN_RECORDS_S)
    assert events["hit"] == pytest.approx(exact.hit_s, abs=BETWEEN_RECORDS_S)


def test_hit_speed_is_the_closed_form():
    truth = draw_truth(np.random.default_rng(3), 20.0, {})
    hit_s = reference(truth, np.zeros(1)).hit_s
    assert hit_s is not None
    before = reference(truth, np.array([hit_s - 1e-9])).velocity_m_s[0, 0, 0]
    assert truth.hit_speed_m_s == pytest.approx(before, abs=1e-6)
    assert replace(truth, friction=(0.5, 0.1)).hit_speed_m_s == 0


def test_given_values_are_kept_even_if_nothing_moves():
    given = {"m1": 0.2, "k1": 0.5, "m2": 0.4, "k2": 0.3}
    truth = draw_truth(np.random.default_rng(0), 10.0, given)
    assert (truth.mass_kg, truth.friction) == ((0.2, 0.4), (0.5, 0.3))
    motion = roll_out(truth)
    assert motion.events_s(truth) == {"foot": None, "hit": None}
    assert motion.rest_s < 0.1


@pytest.mark.video
def test_clip_loads_and_its_truth_is_complete(tmp_path):
    path = tmp_path / "new" / "clip.mp4"
    askew = ("keystone", "roll")
    simulate(path, seed=3, size=(320, 180), seconds=1.0, hand=True, camera_fault=askew)
    assert {item.name for item in path.parent.iterdir()} == {
        "clip.mp4",
        "clip.yaml",
        "clip.truth.json",
    }
    clip = load_clip(path)
    truth = json.loads(path.with_suffix(".truth.json").read_text())
    assert (clip.frame_count, clip.frame_size_px) == (30, (320, 180))
    assert clip.warnings == ()
    assert truth["hand"]["leave"] >= 1
    assert truth["covered"]["object1"][-1] == 0
    for declared in clip.objects:
        start = truth["trajectory"][declared.name]
        x, y, w = truth["world_to_image"] @ np.array([start["y"][0], start["z"][0], 1.0])
        assert declared.point_px == pytest.approx((x / w, y / w), abs=0.051)
    assert truth.keys() >= TRUTH_KEYS
    assert truth["trajectory"].keys() == {"t", "object1", "object2"}
    assert truth["trajectory"]["object1"].keys() == {"y", "z", "pitch", "vy", "vz"}


@pytest.mark.video
def test_same_seed_same_clip(tmp_path):
    clips = []
    for name, seed in (("a", 5), ("b", 5), ("c", 6)):
        path = tmp_path / name / "clip.mp4"
        simulate(path, seed=seed, size=(160, 90), seconds=0.3, no_points=True)
        video = cv2.VideoCapture(str(path))
        frames = [frame for ok, frame in iter(video.read, (False, None)) if ok]
        truth = path.with_suffix(".truth.json").read_text()
        clips.append((np.array(frames), truth))
        assert load_clip(path).objects[0].point_px is None
    assert np.array_equal(clips[0][0], clips[1][0])
    assert clips[0][1] == clips[1][1]
    assert not np.array_equal(clips[0][0], clips[2][0])
    assert clips[0][1] != clips[2][1]


def test_track_has_the_declared_noise(tmp_path):
    path = tmp_path / "clip.csv"
    simulate(path, track_only=True, seconds=3.0, fps=60.0, track_noise=0.001)
    assert load_clip(path).frame_count == 180
    observed = read_observation_csv(path)
    truth = json.loads(path.with_suffix(".truth.json").read_text())["trajectory"]
    exact = [[truth[name]["y"], truth[name]["z"]] for name in observed.names]
    assert (observed.position_m - exact).std() == pytest.approx(0.001, rel=0.15)
    assert observed.covariance_m2[:, 0, 0] == pytest.approx(1e-6)


def test_free_motion(tmp_path):
    """An object hit off centre turns; the yaml says where it stands, the truth where it goes."""
    path = tmp_path / "c.csv"
    simulate(path, track_only=True, motion="free", z2=0.015, seed=1, seconds=1.4)
    clip = load_clip(path)
    assert [each.z_m for each in clip.objects] == [0.0, 0.015]
    truth = json.loads(path.with_suffix(".truth.json").read_text())
    assert truth["motion"] == "free"
    assert truth["z_m"] == {"object1": 0.0, "object2": 0.015}
    moved = truth["trajectory"]["object2"]
    assert moved["across"][0] == 0.015
    assert moved["across"][-1] > 0.016
    assert np.linalg.norm(moved["quaternion"], axis=1) == pytest.approx(1.0, abs=1e-5)
    assert moved["quaternion"][0] == [1, 0, 0, 0]
    assert abs(moved["quaternion"][-1][3]) > 0.2, "turned about the vertical"
    observed = read_observation_csv(path)
    assert observed.position_m[1, 0] == pytest.approx(np.array(moved["y"]), abs=0.001)


def test_free_motion_of_what_meets_squarely_is_planar():
    truth = draw_truth(np.random.default_rng(1), 20.0, {})
    size = (0.06, 0.06, 0.06)
    objects = tuple(each.model_copy(update={"size_m": size}) for each in truth.objects)
    truth = replace(truth, objects=objects)
    free, planar = (roll_out(truth, solver, 1.6) for solver in ("free", "rigid"))
    count = planar.position_m.shape[-1]
    apart = np.abs(free.position_m[..., :count] - planar.position_m)
    assert apart.max() < FREE_ATOL_M
    hit_s = planar.events_s(truth)["hit"]
    assert hit_s is not None
    before = planar.times_s < hit_s - 0.01
    assert apart[..., before].max() < EXACT_M
    assert free.pitch_rad[:, :count][:, before] == pytest.approx(planar.pitch_rad[:, before])
    tipped = np.abs(free.pitch_rad[:, :count] - planar.pitch_rad)
    assert tipped.max() < FREE_TIPPED_RAD
    assert tipped[:, -1].max() < 1e-3
