"""What is found by its motion must be what is followed."""

from types import SimpleNamespace

import numpy as np
import pytest

from galileo_jax.runtime.errors import InputError
from galileo_jax.tracking.clip import _check_followed
from galileo_jax.tracking.detect import Mover

WAY_PX = np.stack([np.linspace(0.0, 150.0, 30), np.zeros(30)], axis=1)


def checked(share: float, point_px=None) -> None:
    """A thing that moves by 150 px, and a track that goes a share of it."""
    mover = Mover((50.0, 40.0), 0, 0, False, np.zeros((4, 2)), WAY_PX)
    declared, found = (
        SimpleNamespace(
            path="a.yaml",
            video="a.mp4",
            objects=(SimpleNamespace(name="bob", point_px=one, first_frame=0),),
        )
        for one in (point_px, (50.0, 40.0))
    )
    track = SimpleNamespace(
        position_px=50 + share * WAY_PX[None], is_visible=np.ones((1, 30), bool)
    )
    _check_followed(declared, found, track, [mover])  # pyright: ignore


def test_a_track_that_stands_still_where_something_moves_is_refused():
    with pytest.raises(
        InputError, match=r"bob\): point_px: missing.*moves by 150 px.*0\.3 px only"
    ):
        checked(0.002)


def test_what_goes_along_is_what_was_found_and_a_mark_is_believed():
    checked(0.9)
    checked(0.002, point_px=(50.0, 40.0))
