"""Objects that somebody has put right, and the frames after the last one that counts."""

import numpy as np
import pytest

from galileo_jax.clip.declaration import CLICK_SD_PX
from galileo_jax.tracking.template import Outline
from galileo_jax.tracking.tracker import Seen, Start, track_video
from tests.tracking.moving_box import Box, film

pytestmark = pytest.mark.video

BOX, OTHER = Box(), Box(seed=8)
LOST_AT, FRAMES, LEAP_PX = 12, 30, 130.0


def steady(start_px: float = 30.0) -> np.ndarray:
    x = start_px + 1.5 * np.arange(FRAMES)
    return np.stack([x, np.full(FRAMES, 50.3), np.zeros(FRAMES)], axis=1)


def leaping() -> np.ndarray:
    """Moved by somebody, farther than anything is looked for."""
    path = steady()
    path[LOST_AT:, 0] += LEAP_PX
    return path


def tracked(frames, start, *clicks, last=None, advance=lambda _: None):
    """Clicks: (frame, (x, y))."""
    outline = Outline(BOX.size_px)
    later = tuple(Start("a", point, outline, frame) for frame, point in clicks)
    begin = Start("a", (start[0], start[1]), outline, 0, last, later)
    return track_video(
        lambda: iter(frames), [begin], np.arange(len(frames)) / 30.0, advance=advance
    )


def test_what_was_lost_is_followed_on_from_a_click_on_it():
    path = leaping()
    frames = film([(BOX, path)], size_px=(300, 120))
    lost = tracked(frames, path[0])
    assert not lost.is_visible[0, LOST_AT:].any()
    click = tuple(path[LOST_AT, :2] + (2.5, -1.5))  # nobody hits the middle
    found = tracked(frames, path[0], (LOST_AT, click))
    assert found.is_visible.all()
    error = np.abs(found.position_px[0] - path[:, :2])
    assert error.max() < 0.15, "the object is what is followed, not the click"
    before = slice(None, LOST_AT)
    assert np.allclose(found.position_px[0, before], lost.position_px[0, before], atol=0.05)


def test_what_looks_otherwise_is_followed_from_the_click_as_well_as_one_clicks():
    path = leaping()
    first, second = (film([(box, path)], size_px=(300, 120)) for box in (BOX, OTHER))
    frames = [*first[:LOST_AT], *second[LOST_AT:]]
    off = np.array([0.6, -0.4])
    found = tracked(frames, path[0], (LOST_AT, tuple(path[LOST_AT, :2] + off)))
    assert found.is_visible.all()
    after = found.position_px[0, LOST_AT:] - path[LOST_AT:, :2]
    assert np.abs(after - off).max() < 0.15
    variance = np.einsum("fii->fi", found.covariance_px2[0])
    assert (variance[LOST_AT:] >= CLICK_SD_PX**2).all()
    assert (variance[:LOST_AT] < CLICK_SD_PX**2 / 4).all()
    assert np.abs(found.angle_rad).max() < np.radians(1)


def test_a_click_where_the_object_is_known_changes_nothing():
    path = steady()
    frames = film([(BOX, path)])
    as_it_was = tracked(frames, path[0])
    clicked = tracked(frames, path[0], (LOST_AT, tuple(path[LOST_AT, :2] + (1.0, 1.0))))
    assert clicked.is_visible.all()
    assert np.abs(clicked.position_px - as_it_was.position_px).max() < 0.05


def test_frames_after_the_last_one_that_counts_are_not_looked_at():
    path = steady()
    seen: list[Seen | None] = []
    found = tracked(film([(BOX, path)]), path[0], last=LOST_AT, advance=seen.append)
    assert found.is_visible[0].tolist() == [frame <= LOST_AT for frame in range(FRAMES)]
    assert np.isnan(found.position_px[0, LOST_AT + 1 :]).all()
    first_pass = [one for one in seen if one is not None]
    assert [one.frame for one in first_pass] == list(range(FRAMES))
    x, _ = first_pass[LOST_AT].places_px[0]  # pyright: ignore
    assert x == pytest.approx(path[LOST_AT, 0], abs=0.5)
