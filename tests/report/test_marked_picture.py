"""The picture that goes with the questions: what moves, its way, its angle, a ruler."""

from pathlib import Path

import cv2
import numpy as np
import pytest

import galileo_jax as gx
from galileo_jax.report.marked_picture import Marked, write_marked_picture
from galileo_jax.runtime.errors import InputError
from tests.api.test_understand import filmed

GREY = np.full((120, 240, 3), 128, np.uint8)


def read(path: Path) -> np.ndarray:
    found = cv2.imread(str(path))
    assert found is not None
    return found


def coloured(path: Path) -> np.ndarray:
    """`[height, width]`, bool, of the size of `GREY`: where a picture is not grey."""
    drawn = cv2.resize(read(path).astype(np.float32), (240, 120))
    return np.ptp(drawn, axis=2) > 30


def test_a_thing_has_its_box_and_its_way_where_they_are(tmp_path):
    way = np.stack([np.linspace(60, 200, 30), np.linspace(30, 80, 30)])
    thing = Marked("1", (60.0, 30.0), (30.0, 20.0), way, 19.7)
    found = coloured(write_marked_picture(tmp_path / "a.png", GREY, [thing]))
    assert found[55, 128:134].any() or found[54:57, 130].any(), "on the way"
    assert found[30, 44:47].any() and found[30, 74:77].any(), "left and right side of the box"
    assert not found[100:, 120:].any() and not found[:15, 120:].any()


def test_without_things_there_is_a_ruler_alone(tmp_path):
    path = write_marked_picture(tmp_path / "a.png", GREY, [])
    assert not coloured(path).any()
    drawn = read(path)[..., 0]
    at = np.flatnonzero((drawn[round(0.96 * len(drawn)) - 3 :] > 200).any(axis=0))
    assert np.ptp(at) * 240 / drawn.shape[1] == pytest.approx(100, abs=1)


@pytest.mark.video
def test_look_draws_it_of_a_film(tmp_path):
    run = 5.0 * np.clip(np.arange(30.0) - 3, 0, 18)
    film = filmed(tmp_path, np.stack([50 + run, 40 + 0.5 * run, 0 * run], axis=1))
    found = coloured(gx.look(film).plot(tmp_path / "what.png"))
    assert found[65:68, 100].any(), "on the way"
    with pytest.raises(InputError, match=r"what\.foo: "):
        gx.look(film).plot(tmp_path / "what.foo")
