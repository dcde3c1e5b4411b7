"""Frames of an oblique camera, drawn square."""

from pathlib import Path

import cv2
import numpy as np
import pytest

from galileo_jax.tracking.square_view import square_view
from tests.clip.test_picture_plane import CAMERA, SIDES_M, filmed


@pytest.mark.parametrize("lens", [{}, {"lens": "{k1: -0.08}"}], ids=["straight", "barrel"])
def test_there_and_back(tmp_path: Path, lens: dict[str, str]) -> None:
    clip = filmed(tmp_path, **lens)
    view = square_view(clip)
    points = CAMERA.project(SIDES_M * 0.9)
    assert view.to_picture(view.from_picture(points)) == pytest.approx(points, abs=1e-3)
    assert all(side % 2 == 0 for side in view.size_px)


def test_a_square_is_drawn_as_a_square(tmp_path: Path) -> None:
    clip = filmed(tmp_path)
    side_m, centre = 0.2, np.array([-0.2, 0.2])
    corners = centre + side_m / 2 * np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]])
    frame = np.zeros((180, 320), np.uint8)
    fixed = np.round(16 * CAMERA.project(corners)).astype(np.int32)
    cv2.fillPoly(frame, [fixed], 255, cv2.LINE_AA, 4)
    view = square_view(clip)
    drawn = next(view.drawn(iter([frame])))
    assert drawn.shape[::-1] == view.size_px
    inside = np.argwhere(drawn > 127)[:, ::-1]
    wide, high = np.ptp(inside, axis=0) + 1
    assert clip.pixels_per_metre is not None
    side_px = side_m * clip.pixels_per_metre
    # A polygon is filled to the edges' outer pixels; in the picture it is no square.
    assert (wide, high) == pytest.approx((side_px, side_px), abs=3)
    assert abs(wide - high) <= 1 < abs(np.subtract(*np.ptp(CAMERA.project(corners), axis=0)))
    middle = view.from_picture(CAMERA.project(centre))
    assert inside.mean(axis=0) == pytest.approx(middle, abs=0.5)
