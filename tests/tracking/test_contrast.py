"""One colour in which what moves is seen."""

import numpy as np
import pytest

from galileo_jax.tracking.contrast import in_contrast
from galileo_jax.tracking.template import grey

pytestmark = pytest.mark.video


def film(colour: tuple[int, int, int]) -> list[np.ndarray]:
    """A ball of a colour, BGR, goes across a wall of greys around 110."""
    wall = np.random.default_rng(1).normal(110, 4, (80, 200, 1)).clip(0, 255)
    row, column = np.indices((80, 200))
    pictures = []
    for n in range(20):
        inside = np.hypot(column - 20 - 8 * n, row - 40) < 9
        pictures.append(np.where(inside[..., None], colour, wall).astype(np.uint8))
    return pictures


def test_a_ball_as_bright_as_the_wall_is_seen_by_its_colour() -> None:
    pictures = film((20, 90, 182))  # grey 109
    assert abs(float(grey(pictures[0])[40, 20]) - 110) < 5
    for picture in in_contrast(lambda: iter(pictures), 20)():
        assert picture.shape == (80, 200) and picture.dtype == np.uint8
    first = next(iter(in_contrast(lambda: iter(pictures), 20)())).astype(float)
    assert abs(first[40, 20] - np.median(first)) > 50


@pytest.mark.parametrize("colour", [(30, 30, 40), (240, 230, 220), (90, 180, 90)])
def test_what_grey_shows_stays_as_it_is(colour: tuple[int, int, int]) -> None:
    pictures = film(colour)
    shown = in_contrast(lambda: iter(pictures), 20)()
    assert all(one is other for one, other in zip(shown, pictures, strict=True))


def test_a_film_in_which_nothing_moves_stays_as_it_is() -> None:
    still = [film((0, 0, 255))[0]] * 20
    assert next(iter(in_contrast(lambda: iter(still), 20)())) is still[0]
