"""Two plain boxes that touch after a hit, followed by their colours."""

import cv2
import numpy as np
import pytest

from galileo_jax.tracking.fragments import Start
from galileo_jax.tracking.own_colour import in_own_colours
from galileo_jax.tracking.template import Outline, grey
from galileo_jax.tracking.tracker import track_video

pytestmark = pytest.mark.video

SIZE = np.array([200, 320])  # height and width of the picture
SIDES = np.array([44.0, 32.0])
HIT, AT_PX = 16, 170.0  # picture, and where the first box then is
RED, GREEN, GREY = (40, 40, 200), (60, 150, 40), (120, 120, 120)


def paths() -> tuple[np.ndarray, np.ndarray]:
    """`[picture, 2]` of each: the first runs into the second, and both go on side by side."""
    step = np.arange(40) - HIT
    first = AT_PX + np.where(step < 0, 6.3 * step, 2.9 * step - 0.05 * step**2)
    second = np.where(step < 0, AT_PX, first) + SIDES[0]
    level = np.full(40, 120.0)
    return np.stack([first, level], axis=1), np.stack([second, level], axis=1)


def filmed(*colours: tuple[int, int, int], noise: float = 2.0) -> list[np.ndarray]:
    """The pictures, before a wall with blotches, noise in each."""
    rng = np.random.default_rng(0)
    blotches = cv2.GaussianBlur(rng.normal(0, 1, (*SIZE, 3)), (0, 0), 6)
    wall = 150 + 12 * blotches / blotches.std()
    pictures = []
    for places in zip(*paths(), strict=True):
        picture = wall
        for place, colour in zip(places, colours, strict=True):
            share = _covered(place)[..., None]
            picture = share * np.array(colour) + (1 - share) * picture
        noisy = picture + rng.normal(0, noise, picture.shape)
        pictures.append(np.clip(np.round(noisy), 0, 255).astype(np.uint8))
    return pictures


def _covered(place: np.ndarray) -> np.ndarray:
    """Of each pixel, the share that a box covers; pixel i reaches from i - 1/2 to i + 1/2."""
    columns, rows = (
        np.clip(
            np.minimum(np.arange(count) + 0.5, middle + side / 2)
            - np.maximum(np.arange(count) - 0.5, middle - side / 2), 0, 1)
        for count, middle, side in zip(SIZE[::-1], place, SIDES, strict=True)
    )  # fmt: skip
    return np.outer(rows, columns)


@pytest.mark.parametrize("is_known", [True, False])
@pytest.mark.parametrize("off_px", [0.0, 4.0])
@pytest.mark.parametrize("noise", [0.1, 2.0])
def test_plain_boxes_that_touch_are_told_apart(noise: float, is_known: bool, off_px: float) -> None:
    """Their sizes may be unknown, and the marks beside their middles."""
    pictures, true = filmed(RED, GREEN, noise=noise), paths()
    outline = Outline(tuple(SIDES) if is_known else None)
    starts = [
        Start(name, tuple(path[0] + off_px), outline)
        for name, path in zip(("red", "green"), true, strict=True)
    ]
    track = track_video(lambda: iter(pictures), starts, np.arange(40) / 30)
    for place, path in zip(track.position_px, true, strict=True):
        error = np.linalg.norm(place - path - off_px, axis=1)
        assert np.isfinite(error).mean() > 0.9
        assert np.nanmedian(error) < 0.2 and np.nanmax(error) < 0.8


def test_what_has_texture_or_no_colour_is_looked_at_in_grey() -> None:
    true = paths()
    starts = [Start(str(k), tuple(path[0]), Outline(tuple(SIDES))) for k, path in enumerate(true)]
    for pictures in (
        filmed(RED, RED),
        filmed((200, 200, 200), GREY),
        [grey(filmed(RED, GREEN)[0])],
    ):
        assert [one.view for one in in_own_colours(lambda p=pictures: iter(p), starts)] == [
            grey
        ] * 2
    speckled = filmed(RED, GREEN, noise=40.0)
    assert [one.view for one in in_own_colours(lambda: iter(speckled), starts)] == [grey] * 2
    (alone,) = in_own_colours(lambda: iter(filmed(RED, GREEN)), starts[:1])
    assert alone.view is grey
