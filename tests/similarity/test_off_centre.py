"""A point that is marked off its puck's centre goes round it, and is no misfit."""

from dataclasses import replace

import numpy as np
import pytest

from galileo_jax.observation.observation import Observation
from galileo_jax.similarity.gaussian_likelihood import whitening_in
from galileo_jax.similarity.level_discrepancy import CENTRE_SHARE, level_modes
from tests.ramp_model import HIT, make_surroundings

RADIUS_M, SD_M, FRAMES, FPS = 0.03, 1e-4, 60, 60.0
SCENE = replace(
    make_surroundings(HIT),
    names=("one", "other"),
    half_length_m=(RADIUS_M, 2 * RADIUS_M),
    has_table=False,
    comes_down=(False, False),
    moves_in_plane=True,
    angle_rad=0.0,
)
TIMES = np.arange(FRAMES) / FPS
TURNED = 0.4 + 5.0 * TIMES
UNSEEN = 7


def pucks(turned: np.ndarray | None, axes: int = 2) -> Observation:
    """Two pucks far from each other; `turned` `[object, frame]`, of a film or as a third axis."""
    place = np.zeros((2, axes, FRAMES))
    place[0, 0], place[1, 1] = 0.5 * TIMES, 1.0
    if axes == 3 and turned is not None:
        place[:, 2] = turned
    error = SD_M**2 * np.eye(axes)[None, :, :, None]
    mask = np.ones((2, FRAMES), bool)
    mask[0, UNSEEN] = False
    return Observation(
        SCENE.names, TIMES, place, np.broadcast_to(error, (2, axes, axes, FRAMES)), mask,
        is_turning=axes == 3, turned_rad=turned if axes == 2 else None,
    )  # fmt: skip


def film() -> Observation:
    turned = np.stack([TURNED, np.full(FRAMES, np.nan)])
    turned[0, UNSEEN] = np.nan
    return pucks(turned)


def added(seen: Observation) -> np.ndarray:
    """The modes that turning adds."""
    without = level_modes(replace(seen, turned_rad=None), SCENE, is_filmed=False)
    with_it = level_modes(seen, SCENE, is_filmed=False)
    assert np.array_equal(with_it[: len(without)], without)
    return with_it[len(without) :]


def test_the_point_goes_round_with_the_puck() -> None:
    along, across = added(film())
    known = np.arange(FRAMES) != UNSEEN
    angle = (TURNED - TURNED[0])[known]
    size = CENTRE_SHARE * RADIUS_M
    assert along[0][:, known] == pytest.approx(size * np.array([np.cos(angle), np.sin(angle)]))
    assert across[0][:, known] == pytest.approx(size * np.array([-np.sin(angle), np.cos(angle)]))


def test_of_a_puck_that_does_not_show_its_turning_there_is_none() -> None:
    assert not added(film())[:, 1].any()
    assert len(added(pucks(np.full((2, FRAMES), np.nan)))) == 0


def test_a_track_with_angles_has_the_same() -> None:
    turned = np.stack([TURNED, np.zeros(FRAMES)])
    film_of_it = added(pucks(turned))
    read = level_modes(pucks(turned, axes=3), SCENE, is_filmed=False)
    assert np.array_equal(read[-4:, :, :2], film_of_it)
    assert not read[-4:, :, 2].any(), "an angle has no centre"


def test_a_point_off_the_centre_is_no_misfit() -> None:
    """2 mm off it draws a circle; and of a puck whose turning nobody knows that is a misfit."""
    seen = film()
    off = np.zeros_like(seen.position_m)
    off[0] = 0.002 * np.array([np.cos(TURNED), np.sin(TURNED)])

    def misfit(turning: np.ndarray | None) -> float:
        there = replace(seen, turned_rad=turning)
        data = whitening_in(there, SCENE, noise="bodies")
        return float(np.sum(data.whiten_batch(off, 1.0) ** 2))

    assert misfit(seen.turned_rad) < 2
    assert misfit(None) > 100
