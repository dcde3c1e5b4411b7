"""Finding the objects by their motion."""

import numpy as np
import pytest

from galileo_jax.tracking.detect import find_movers, fit_outline
from galileo_jax.tracking.pose import rotation
from galileo_jax.tracking.template import Outline, grey
from tests.tracking.moving_box import RELEASE, Box, Labelled, Ringed, film, throw

pytestmark = pytest.mark.video

FIRST, SECOND, HAND = Box(seed=0), Box(seed=4), Box((40, 30), seed=7)


def paths():
    """Object 1 slides from frame 6 and stops; object 2 sets out at 20; a hand leaves at 3."""
    time = np.arange(40.0)
    zero = 0 * time
    first = np.stack([40 + 4.0 * np.clip(time - 6, 0, 18), 80 + zero, zero], axis=1)
    second = np.stack([160 + 2.0 * np.clip(time - 20, 0, 12), 80 + zero, zero], axis=1)
    hand = np.stack([40 - 9.0 * np.clip(time - 3, 0, 40), 35 + zero, zero], axis=1)
    return first, second, hand


def test_objects_are_found_in_the_order_of_their_motion_and_the_hand_last():
    first, second, hand = paths()
    frames = film([(SECOND, second), (FIRST, first), (HAND, hand)])
    movers = find_movers(lambda: iter(frames), 32)
    assert [mover.leaves_picture for mover in movers] == [False, False, True]
    for mover, path in zip(movers, (first, second), strict=False):
        np.testing.assert_allclose(mover.point_px, path[0, :2], atol=3)


def test_nothing_that_moves_gives_nothing():
    first, second, _ = paths()
    still = [(FIRST, first[:1].repeat(10, axis=0)), (SECOND, second[:1].repeat(10, axis=0))]
    frames = film(still)
    assert find_movers(lambda: iter(frames), 32) == []


@pytest.mark.parametrize("first", [0, 3])
def test_a_small_ball_in_fast_flight_is_found_by_its_silhouette(first: int):
    """It goes by 2.5 of its sizes a frame, and may come into the picture later."""
    time = np.arange(12.0)
    zero = 0 * time
    flight = np.stack([25 + 24.0 * (time - first), 120 - 26 * time + 2.2 * time**2, zero], axis=1)
    flight[time < first, 0] = -100
    frames = film([(Box((10, 10), seed=3), flight)], size_px=(320, 160))
    (mover,) = find_movers(lambda: iter(frames), 32)
    assert mover.first_frame == first and mover.goes_right and not mover.num_features
    np.testing.assert_allclose(mover.point_px, flight[first, :2], atol=1.5)


@pytest.mark.parametrize("wanted", [0, 1])
def test_a_silhouette_alone_is_found_though_none_is_asked_for(wanted: int):
    """Its outline is, where all are marked and their sizes are not known."""
    time = np.arange(12.0)
    path = np.stack([25 + 24.0 * time, 80 + 0 * time, 0 * time], axis=1)
    frames = film([(Box((10, 10), seed=3), path)], size_px=(320, 160))
    (mover,) = find_movers(lambda: iter(frames), 32, may_fly=False, wanted=wanted)
    assert not mover.num_features
    np.testing.assert_allclose(mover.point_px, path[0, :2], atol=1.5)


def test_a_thing_whose_middle_is_plain_is_one_thing():
    left, _, _ = paths()
    right = left + np.array([52.0, 0, 0])
    frames = film([(Box((12, 26), seed=0), left), (Box((12, 26), seed=4), right)])
    (mover,) = find_movers(lambda: iter(frames), 44)
    np.testing.assert_allclose(mover.point_px, [66, 80], atol=3)


@pytest.mark.parametrize("turn_rad", [0.0, 0.25])
def test_the_middle_of_a_labelled_box_is_not_that_of_its_label(turn_rad):
    """Its features may all be on the label, far to the side; as it goes on it may turn."""
    time = np.arange(40.0)
    gone = 5.0 * np.clip(time - 6, 0, 24)
    way = np.stack([50 + gone, 60 + 0.4 * gone, turn_rad - turn_rad * (gone > 60)], axis=1)
    frames = film([(Labelled(), way)], size_px=(280, 180))
    (mover,) = find_movers(lambda: iter(frames), 44)
    np.testing.assert_allclose(mover.point_px, way[0, :2], atol=1.5)
    size = np.ptp(mover.places_px @ rotation(turn_rad), axis=0) + 2.0  # features lie inside
    np.testing.assert_allclose(size, Labelled().size_px, rtol=0.1)


def test_what_comes_to_where_a_thing_was_does_not_make_it_larger():
    """Object 1 stops where object 2 has been."""
    time = np.arange(40.0)
    zero = 0 * time
    second = np.stack([130 + 6.0 * np.clip(time - 9, 0, 18), 80 + zero, zero], axis=1)
    first = np.stack([50 + 4.0 * np.clip(time - 4, 0, 20), 80 + zero, zero], axis=1)
    frames = film([(Labelled(seed=2), second), (Labelled(), first)], size_px=(320, 160))
    movers = find_movers(lambda: iter(frames), 44)
    assert len(movers) == 2
    for mover, path in zip(movers, (first, second), strict=True):
        np.testing.assert_allclose(mover.point_px, path[0, :2], atol=1.5)


def test_a_hand_is_no_part_of_the_box_that_it_lets_go():
    """It covers a part of the box at first, and both set out in the same frame."""
    time = np.arange(40.0)
    gone = np.clip(time - 6, 0, 30)
    box = np.stack([90 + 4.0 * gone, 100 + 0 * time, 0 * time], axis=1)
    hand = np.stack([56 - 3.0 * gone, 78 - 5.0 * gone, 0 * time], axis=1)
    frames = film([(Ringed(), box), (Box((56, 44), seed=7), hand)], size_px=(320, 160))
    first, *others = find_movers(lambda: iter(frames), 44)
    np.testing.assert_allclose(first.point_px, box[0, :2], atol=2)
    size = np.ptp(first.places_px, axis=0) + 2.0
    np.testing.assert_allclose(size, Ringed().size_px, rtol=0.1)
    assert all(other.leaves_picture for other in others)
    np.testing.assert_allclose(first.way_px[20], box[20, :2] - box[0, :2], atol=0.5)


def test_two_things_that_set_out_together_and_part_are_two():
    first, _, _ = paths()
    second = first + np.array([40.0, 0, 0])
    second[:, 0] += 1.5 * np.clip(np.arange(40.0) - 8, 0, None)
    frames = film([(Box((12, 26), seed=0), first), (Box((12, 26), seed=4), second)])
    assert len(find_movers(lambda: iter(frames), 44)) == 2


def test_outline_is_moved_to_the_sharp_sides():
    pose = np.array([80.4, 60.2, 0.3])
    image = grey(film([(FIRST, pose[None])])[0])
    c, s = np.cos(0.3), np.sin(0.3)
    # Features were only found on the right half.
    own = np.array([[0, -11], [14, 10], [13, -10], [1, 11], [6, 0]])
    places = own @ np.array([[c, s], [-s, c]]) + pose[:2]
    centre = fit_outline(image, places, Outline(FIRST.size_px, 0.3))
    np.testing.assert_allclose(centre, pose[:2], atol=1.0)


def test_of_a_hand_that_throws_a_ball_the_ball_comes_first():
    """It is seen from when it leaves the hand, by its colour: it is as bright as what is behind."""
    frames, ball = throw()
    first, *others = find_movers(lambda: iter(frames), 40)
    assert first.flies and not any(other.flies for other in others)
    assert RELEASE <= first.first_frame < RELEASE + 5
    np.testing.assert_allclose(first.point_px, ball[first.first_frame], atol=1)


def test_a_disc_is_moved_to_its_edge():
    """What rolls turns features away from one half of it, and has more inside."""
    row, column = np.indices((120, 160))
    far = np.hypot(column - 80.4, row - 60.2)
    image = np.where(far < 26, 200.0, 90.0)
    image[(far < 26) & (column > 84) & (abs(row - 60) < 12)] = 60.0
    places = np.array([[84.0, 49.0], [104.0, 70.0], [84.0, 71.0], [103.0, 50.0]])
    centre = fit_outline(image.astype(np.uint8), places, Outline((52.0, 52.0), is_round=True))
    np.testing.assert_allclose(centre, [80.4, 60.2], atol=1.0)
