"""Two boxes that turn aside while one pushes the other end the track."""

from dataclasses import replace

import numpy as np
import pytest

from galileo_jax.measurement.segments.ramp_ends import FOLDS
from galileo_jax.measurement.segments.segments import Segments, segment
from galileo_jax.observation.observation import Observation
from tests.measurement.test_find_tip import clip_of
from tests.oracle_trials import FPS, observe
from tests.ramp_model import HIT

PARTS = replace(HIT, friction=(0.2, 0.1))


def closer(seen: Observation, frame: int, by_m: np.ndarray) -> Observation:
    """Object 1 further ahead by `by_m` from a frame on, the last value to the end."""
    place = seen.position_m.copy()
    more = np.full(place.shape[-1], by_m[-1])
    more[: frame + len(by_m)] = np.append(np.zeros(frame), by_m)
    place[0, 0] += more
    return replace(seen, position_m=place)


def frame_of_hit(seen: Observation) -> int:
    return int(np.argmax(seen.position_m[1, 0] > 0.252))


@pytest.mark.parametrize("seed", range(3))
def test_one_that_slides_past_ends_the_track(seed):
    seen = observe(HIT, seed)
    frame = frame_of_hit(seen) + 8
    folded = closer(seen, frame, 1e-3 * np.arange(1, 8) ** 1.5)
    segments = segment(clip_of(HIT), folded)
    (why,), used = segments.cuts, segments.used(folded)
    assert (why.name, why.side, why.why) == ("object1", "after", FOLDS)
    assert abs(round(why.time_s * FPS) - frame) <= 2
    assert used.mask[:, : frame - 2].all() and not used.mask[:, frame + 2 :].any()


@pytest.mark.parametrize("experiment", [HIT, PARTS], ids=["pushes", "parts"])
def test_bodies_that_slide_along_a_line(experiment):
    for seed in range(5):
        seen = observe(experiment, seed)
        assert segment(clip_of(experiment), seen) == Segments()


def test_those_that_part_and_meet_again():
    """They touch where they touched, however far apart the frame after the hit shows them."""
    seen = observe(HIT, 0)
    hit = frame_of_hit(seen)
    parted = 1e-3 * np.array([15.0, 25.0, 25.0, 15.0, 0.0])
    place = seen.position_m.copy()
    place[1, 0, hit : hit + 5] += parted
    bounced = replace(seen, position_m=place)
    assert segment(clip_of(HIT), bounced) == Segments()


def test_a_wrong_length_is_no_fold():
    """Of objects declared 10 mm too long."""
    seen = observe(HIT, 0)
    long = replace(HIT, size_m=((0.07, 0.06), (0.07, 0.06)))
    assert segment(clip_of(long), seen) == Segments()
