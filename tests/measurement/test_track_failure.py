"""Tracks that leave their object are told of; tracks of what really happens are not."""

import json
from collections.abc import Callable
from pathlib import Path

import cv2
import numpy as np
import pytest

import galileo_jax as gx
from galileo_jax.clip.load import load_clip
from galileo_jax.measurement.measure import Measurement, measure
from galileo_jax.measurement.segments.track_failure import longest_absence
from galileo_jax.observation.observation import Observation
from galileo_jax.video import decode

FPS = 30.0
SWAPPED_FRAME = 10
"""Object 1 is on its way down the ramp, and nobody near it."""

Change = Callable[[list[np.ndarray], np.ndarray, int], None]


@pytest.fixture(scope="module")
def clip(tmp_path_factory) -> Path:
    path = tmp_path_factory.mktemp("astray") / "clip.mp4"
    gx.simulate(path, seed=11)
    return path


def altered(clip: Path, name: str, change: Change) -> Path:
    """The clip with frames as `change` leaves them; it is given object 1's true places, px."""
    truth = json.loads(clip.with_suffix(".truth.json").read_text())
    true = truth["trajectory"]["object1"]
    places = np.array(truth["world_to_image"])[:2] @ [true["y"], true["z"], np.ones(len(true["y"]))]
    frames = [frame.copy() for frame in decode.frames(clip)]
    half = round(0.75 * max(truth["size1_m"]) * truth["pixels_per_metre_true"])
    change(frames, places.T.round().astype(int), half)
    path = clip.with_name(f"{name}.mp4")
    size = frames[0].shape[1::-1]
    writer = cv2.VideoWriter(str(path), cv2.VideoWriter.fourcc(*"mp4v"), FPS, size)
    for frame in frames:
        writer.write(frame)
    writer.release()
    declared = clip.with_suffix(".yaml").read_text().replace(clip.name, path.name)
    path.with_suffix(".yaml").write_text(declared)
    return path


def around(frame: np.ndarray, place: np.ndarray, half: int) -> np.ndarray:
    x, y = place
    return frame[y - half : y + half, x - half : x + half]


def twin_stays(frames: list[np.ndarray], places: np.ndarray, half: int) -> None:
    """From a frame on something stands there that looks the same; the object goes on."""
    twin = around(frames[0], places[0], half).copy()
    for frame in frames[SWAPPED_FRAME:]:
        around(frame, places[SWAPPED_FRAME], half)[:] = twin


def looks_different(frames: list[np.ndarray], places: np.ndarray, half: int) -> None:
    """From a frame on the object has another face."""
    half = half * 2 // 3
    noise = np.random.default_rng(5).integers(0, 255, (2 * half, 2 * half, 3))
    face = cv2.GaussianBlur(noise.astype(np.uint8), (0, 0), 2)
    for frame, place in list(zip(frames, places, strict=False))[SWAPPED_FRAME:]:
        around(frame, place, half)[:] = face


def passes_behind(frames: list[np.ndarray], places: np.ndarray, half: int) -> None:
    """Something stands before the ramp all the time, and the object is behind it for a while."""
    noise = np.random.default_rng(5).integers(0, 255, (2 * half, 2 * half, 3))
    thing = cv2.GaussianBlur(noise.astype(np.uint8), (0, 0), 2)
    for frame in frames:
        around(frame, places[SWAPPED_FRAME], half)[:] = thing


def measured(clip: Path, name: str, change: Change) -> Measurement:
    return measure(load_clip(altered(clip, name, change)))


@pytest.mark.parametrize(
    "change, why", [(twin_stays, "its velocity jumps"), (looks_different, "looks like")]
)
def test_a_lost_object_is_told_with_its_time(clip: Path, change: Change, why: str) -> None:
    found = measured(clip, change.__name__, change)
    (one,) = found.astray
    assert one.name == "object1"
    assert one.time_s == pytest.approx(SWAPPED_FRAME / FPS, abs=1.5 / FPS)
    assert why in one.why
    assert not found.observation.mask[0, found.observation.times_s > SWAPPED_FRAME / FPS].any()
    (doubt,) = found.doubts
    assert f"object1 is lost from {one.time_s:.2f} s on: {one.why}" in doubt
    assert "see the overlay: galileo track" in doubt
    is_first = found.impossible is not None
    assert is_first == (change is twin_stays), "what is before a leap may be wrong, too"


def test_the_status_of_a_fit_says_that_it_is_of_a_lost_object(clip: Path, tmp_path: Path) -> None:
    path = altered(clip, "fitted", twin_stays)
    found = gx.fit(path).save(tmp_path / "run", report=False)
    result = json.loads((tmp_path / "run" / "result.json").read_text())
    assert result["status"].endswith(f"; but {measure(load_clip(path)).astray[0]}")
    assert any("object1 is lost from" in line for line in found.warnings)


def test_what_is_hidden_for_a_while_is_not_lost(clip: Path) -> None:
    found = measured(clip, "behind", passes_behind)
    assert not found.observation.mask[0].all()
    assert found.astray == ()


@pytest.mark.parametrize(
    "seed, made",
    [
        (61, {"effects": ["restitution"], "strength": 1.0}),
        (62, {"effects": ["initial_push"], "strength": 1.0}),
        (63, {"angle": 35.0, "direction": "left", "fps": 60.0}),
        (64, {"hand": True, "faults": True}),
    ],
    ids=["restitution", "push", "steep", "hand"],
)
def test_hits_pushes_and_the_foot_are_no_sign(seed: int, made: dict, tmp_path: Path) -> None:
    gx.simulate(tmp_path / "clip.mp4", seed=seed, **made)
    assert measure(load_clip(tmp_path / "clip.mp4")).astray == ()


def test_the_longest_absence_is_one_from_which_the_object_comes_back() -> None:
    mask = np.ones((2, 60), bool)
    mask[0, 5:9] = False
    mask[1, 20:40] = mask[1, 50:] = False
    nothing = np.zeros((2, 2, 60)), np.zeros((2, 2, 2, 60))
    seen = Observation(("object1", "object2"), np.arange(60) / 10, *nothing, mask)
    assert longest_absence(seen) == ("object2", 2.0, 4.0)
    mask[1] = True
    assert longest_absence(seen) is None
