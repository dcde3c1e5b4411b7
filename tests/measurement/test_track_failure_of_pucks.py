"""Pucks whose tracks share a place, or leap where they can meet nobody, are left out from there."""

from pathlib import Path

import numpy as np
import pytest

from galileo_jax.clip.schema import Clip, ClipObject
from galileo_jax.measurement.segments.segments import Segments
from galileo_jax.measurement.segments.track_failure import Astray, find_astray
from galileo_jax.observation.observation import Observation
from galileo_jax.tracking.track import Track

FPS, FRAMES, AT = 60.0, 40, 20
RADIUS_M, SD_M = 0.03, 1e-4
NAMES = ("one", "other")


def looked_for(
    place: np.ndarray, unseen: slice | None = None, which: int = 1
) -> tuple[Observation, tuple[Astray, ...]]:
    """What is found in tracks `[object, axis, frame]`, m, of which one is unseen meanwhile."""
    clip = Clip(
        path=Path("pucks.yaml"),
        video=Path("pucks.mp4"),
        track=None,
        scenario="from_above",
        fps=FPS,
        frame_count=FRAMES,
        pixels_per_metre=1000.0,
        objects=tuple(
            ClipObject(name=name, shape="cylinder", size_m=(RADIUS_M, 0.01)) for name in NAMES
        ),
    )
    mask = np.ones((2, FRAMES), bool)
    if unseen is not None:
        mask[which, unseen] = False
    place = np.where(mask[:, None], place, np.nan)
    error = np.broadcast_to(SD_M**2 * np.eye(2)[None, :, :, None], (2, 2, 2, FRAMES))
    times = np.arange(FRAMES) / FPS
    seen = Observation(NAMES, times, place, error, mask)
    square = np.zeros((2, FRAMES, 2, 2))
    pixels = Track(
        NAMES, times, 1000 * np.moveaxis(place, 1, 2), square, square,
        np.zeros((2, FRAMES, 0, 2)), np.zeros((2, FRAMES)), mask, (1000, 1000),
    )  # fmt: skip
    return seen, find_astray(clip, seen, pixels)


def slides(other_m: tuple[float, float], back: bool = False, speed_m_s: float = 0.6) -> np.ndarray:
    """One slides along x, from a frame on perhaps back, and the other lies somewhere."""
    place = np.zeros((2, 2, FRAMES))
    gone = np.arange(FRAMES)
    place[0, 0] = speed_m_s / FPS * np.where(back & (gone > AT), 2 * AT - gone, gone)
    place[1] = np.array(other_m)[:, None]
    return place


def test_tracks_at_one_place_are_both_left_out_from_there() -> None:
    place = slides((0.5, 0.0))
    place[1][:, AT:] = place[0][:, AT:] + np.array([[0.03], [0.0]])  # half of a disc apart
    seen, found = looked_for(place)
    assert [(one.name, one.time_s, one.is_left_out) for one in found] == [
        (name, AT / FPS, True) for name in NAMES
    ]
    assert "same place as other" in found[0].why and "same place as one" in found[1].why
    kept = Segments(astray=found).used(seen).mask
    assert kept[:, :AT].all() and not kept[:, AT:].any()


def test_pucks_that_touch_are_two() -> None:
    place = slides((0.5, 0.0))
    place[1][:, AT:] = place[0][:, AT:] + np.array([[0.98 * 2 * RADIUS_M], [0.0]])
    _, found = looked_for(place)
    assert not any("is where" in one.why for one in found)


def test_a_puck_that_turns_back_far_from_all_is_left_out_from_there() -> None:
    seen, (found,) = looked_for(slides((0.2, 0.5), back=True))
    assert (found.name, found.is_left_out) == ("one", True)
    assert found.time_s == pytest.approx(AT / FPS)
    assert "hits nothing" in found.why and "left out" in found.why
    kept = Segments(astray=(found,)).used(seen).mask
    assert kept[1].all() and kept[0, :AT].all() and not kept[0, AT:].any()


@pytest.mark.parametrize("y_m", [0.07, -0.07])
def test_a_puck_that_turns_back_beside_another_may_have_been_struck(y_m: float) -> None:
    """It turns at x = 0.2 m; discs of 3 cm whose centres come within 9 cm may meet."""
    assert looked_for(slides((0.2, y_m), back=True))[1] == ()
    (found,) = looked_for(slides((0.2, 2 * y_m), back=True))[1]
    assert found.name == "one"


def test_a_puck_may_be_struck_between_two_frames() -> None:
    """It goes 0.3 m in a frame: at neither end of that way is the other near, half way it is."""
    speed = 0.3 * FPS
    half_way = 0.3 * (AT - 0.5)
    assert looked_for(slides((half_way, 0.08), back=True, speed_m_s=speed))[1] == ()
    (found,) = looked_for(slides((half_way, 0.12), back=True, speed_m_s=speed))[1]
    assert found.name == "one"


def test_what_is_not_seen_may_be_there() -> None:
    unseen = slice(AT - 3, AT + 3)
    assert looked_for(slides((0.2, 0.5), back=True), unseen)[1] == ()


def test_a_puck_that_is_seen_in_two_frames_only_is_lost() -> None:
    _, (found,) = looked_for(slides((0.2, 0.5)), slice(2, None), which=0)
    assert (found.name, found.is_left_out) == ("one", False)
    assert found.time_s == pytest.approx(2 / FPS)
    assert "nothing there looks like it" in found.why
