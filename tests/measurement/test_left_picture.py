"""What has left the picture is not lost."""

from dataclasses import replace

import numpy as np
import pytest

from galileo_jax.measurement.measure import _left_picture
from galileo_jax.tracking.track import Track

FRAMES, WIDTH, HEIGHT = 60, 640, 360


def track(speed_px, last):
    """One object that goes to the right from x = 100 and is seen until a frame."""
    x = 100.0 + speed_px * np.arange(FRAMES)
    is_visible = (np.arange(FRAMES) <= last)[None]
    place = np.stack([x, np.full(FRAMES, 100.0)], axis=-1)[None]
    none = np.zeros((1, FRAMES, 2, 2))
    return Track(
        names=("ball",),
        times_s=np.arange(FRAMES) / 60,
        position_px=np.where(is_visible[..., None], place, np.nan),
        covariance_px2=none,
        common_px2=none,
        shifts_px=np.zeros((1, FRAMES, 0, 2)),
        angle_rad=np.zeros((1, FRAMES)),
        is_visible=is_visible,
        frame_size_px=(WIDTH, HEIGHT),
    )


@pytest.mark.parametrize(
    ("speed_px", "last", "expected"),
    [(20.0, 25, 26), (20.0, 10, FRAMES), (0.0, 30, FRAMES), (-10.0, 8, 9), (20.0, 2, FRAMES)],
)
def test_it_has_left_where_it_went_on_beyond_the_edge(speed_px, last, expected):
    """Near an edge on its way out; in mid picture it is lost, at rest it is hidden."""
    assert _left_picture(track(speed_px, last)) == expected


def test_who_stays_keeps_the_scene():
    """Of two objects one leaves: the other may still be seen."""
    gone, stays = track(20.0, 25), track(0.0, FRAMES)
    both = replace(
        gone,
        names=("one", "other"),
        position_px=np.concatenate([gone.position_px, stays.position_px]),
        is_visible=np.concatenate([gone.is_visible, stays.is_visible]),
    )
    assert _left_picture(both) == FRAMES
