"""An object that comes back to the foot of its ramp ends the track, whatever brought it back."""

from dataclasses import replace

import numpy as np
import pytest

from galileo_jax.measurement.segments.ramp_ends import RETURNS
from galileo_jax.measurement.segments.segments import Segments, segment
from tests.measurement.test_find_tip import clip_of
from tests.oracle_trials import FPS, observe
from tests.ramp_model import HIT


def pulled_back(seed: int, to_m: float):
    """Object 1 turns round on the table, and goes back to a place."""
    seen = observe(HIT, seed)
    place = seen.position_m.copy()
    turn = int(np.argmax(place[0, 0] > 0.15))
    back = place[0, 0, turn] - 0.4 * np.arange(place.shape[-1] - turn) / FPS
    place[0, 0, turn:] = np.maximum(back, to_m)
    return replace(seen, position_m=place), turn


@pytest.mark.parametrize("seed", range(3))
def test_one_that_comes_back_to_the_foot(seed):
    clip = clip_of(HIT)
    assert clip.objects[0].size_m is not None
    half = clip.objects[0].size_m[0] / 2
    seen, _ = pulled_back(seed, half - 5e-3)
    segments = segment(clip, seen)
    (why,), used = segments.cuts, segments.used(seen)
    assert (why.name, why.side, why.why) == ("object1", "after", RETURNS)
    last = round(why.time_s * FPS)
    assert seen.position_m[0, 0, last] > half > seen.position_m[0, 0, last + 2]
    assert used.mask[:, : last + 1].all() and not used.mask[:, last + 1 :].any()


def test_one_that_turns_back_on_the_table():
    seen, _ = pulled_back(0, 0.08)
    assert segment(clip_of(HIT), seen) == Segments()
