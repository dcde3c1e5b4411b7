"""Where a run ends: at what stops an object within a step, and not at what brakes it."""

from pathlib import Path

import numpy as np
import pytest

from galileo_jax.clip.load import load_clip
from galileo_jax.measurement.measure import measure
from galileo_jax.measurement.truncate_at_stop import arrest_frame, truncate_at_stop
from galileo_jax.observation.observation import Observation

NOISE_M = 1e-4
DOWN = np.array([np.cos(0.4), -np.sin(0.4)])


def slid(speed_m_s: np.ndarray, fps: float, seed: int = 0) -> Observation:
    """An object that goes `speed_m_s` `[step]` down a board."""
    way = np.concatenate([[0.0], np.cumsum(speed_m_s) / fps])
    place = way * DOWN[:, None]
    place = place + NOISE_M * np.random.default_rng(seed).standard_normal(place.shape)
    count = len(way)
    error = np.broadcast_to(NOISE_M**2 * np.eye(2)[None, :, :, None], (1, 2, 2, count))
    seen = np.ones((1, count), bool)
    return Observation(("object1",), np.arange(count) / fps, place[None], error, seen)


@pytest.mark.parametrize("fps", [30.0, 60.0, 240.0])
@pytest.mark.parametrize("rebound", [0.0, -0.3, 0.1])
def test_a_stop_ends_the_run(fps, rebound):
    before = 1.2 * np.arange(1, int(fps)) / fps
    after = np.full(4, rebound * before[-1])
    assert arrest_frame(slid(np.append(before, after), fps)) == len(before)


def test_a_smeared_step_goes_too():
    before = 1.2 * np.arange(1, 240) / 240
    hit = np.array([0.8, 0.4, 0.1, 0.1]) * before[-1]
    assert arrest_frame(slid(np.append(before, hit), 240.0)) == len(before)


@pytest.mark.parametrize("fps", [30.0, 60.0])
@pytest.mark.parametrize(
    "brake_per_s", [2.0, 5.0, 10.0], ids=["weak brake", "brake", "strong brake"]
)
def test_what_brakes_is_no_stop(brake_per_s, fps):
    """A zone in which a drag begins at once, whatever comes after; and friction to a rest."""
    fast = np.minimum(1.2 * np.arange(1, int(fps)) / fps, 1.0)
    slow = fast[-1] * np.exp(-brake_per_s * np.arange(1, int(fps)) / fps)
    assert arrest_frame(slid(np.append(fast, slow), fps)) is None
    rest = np.clip(1.0 - 9.81 * np.arange(1, int(fps)) / fps, 0.0, None)
    assert arrest_frame(slid(np.append(fast, rest), fps)) is None


def write_clip(folder: Path, scenario: str, more: str = "") -> Path:
    """A run with a stop at its end: its csv and yaml; returns the yaml."""
    seen = slid(np.append(1.2 * np.arange(1, 60) / 60, np.zeros(5)), 60.0)
    rows = [
        f"{t},{x},{y},{NOISE_M}" for t, x, y in zip(seen.times_s, *seen.position_m[0], strict=True)
    ]
    head = "time_s,object1_x_m,object1_y_m,object1_sd_m"
    (folder / "run.csv").write_text("\n".join([head, *rows]) + "\n")
    path = folder / "run.yaml"
    path.write_text(
        f"track: run.csv\nscenario: {scenario}\n{more}objects:\n"
        "  - {name: object1, shape: sphere, size_m: [0.03]}\n"
    )
    return path


def test_what_follows_is_left_out_and_it_is_said(tmp_path):
    measured = measure(load_clip(write_clip(tmp_path, "fall")))
    seen = measured.observation.mask[0]
    assert seen[:60].all() and not seen[60:].any()
    (remark,) = measured.remarks
    assert "object1 is stopped by something after 0.983 s" in remark
    assert measured.whole.mask[0, 60:].any(), "the whole track is still there"


def test_a_declared_floor_is_in_the_scene(tmp_path):
    """What bounces on it is not cut off."""
    clip = load_clip(write_clip(tmp_path, "fall", "floor: true\n"))
    seen = slid(np.append(1.2 * np.arange(1, 60) / 60, np.zeros(5)), 60.0)
    assert truncate_at_stop(clip, seen) == (seen, None)
    bare = clip.model_copy(update={"floor": False})
    assert truncate_at_stop(bare, seen)[1] == pytest.approx(59 / 60)
