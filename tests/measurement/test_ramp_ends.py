"""What ends a motion on ramp and table, and what does not: tipping, turning aside, coming back."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from galileo_jax.clip.schema import Clip, ClipObject
from galileo_jax.measurement.segments.ramp_ends import FOLDS, RETURNS, TIPS_OVER
from galileo_jax.measurement.segments.segments import Segments, segment
from galileo_jax.observation.observation import Observation
from tests.oracle_trials import FPS, observe
from tests.ramp_model import HIT

TALL = replace(HIT, size_m=((0.05, 0.08), (0.06, 0.06)))
CUBES = HIT
EDGE_M = 0.047 - 0.04  # by how much the tall box's centre is higher on an edge than on its face


def clip_of(experiment) -> Clip:
    sizes = [(length, 0.06, height) for length, height in experiment.size_m]
    return Clip(
        path=Path("made.yaml"),
        track=Path("made.csv"),
        scenario="ramp",
        fps=FPS,
        ramp_angle_deg=float(np.degrees(experiment.angle_rad)),
        objects=tuple(
            ClipObject(name=f"object{i + 1}", shape="box", size_m=size)
            for i, size in enumerate(sizes)
        ),
        frame_count=48,
    )


def raised(seen: Observation, i: int, frame: int, rise_m: np.ndarray, then_m: float) -> Observation:
    """Object `i` raised by `rise_m` `[frame]` from a frame on, and by `then_m` after these."""
    place = seen.position_m.copy()
    place[i, 1, frame : frame + len(rise_m)] += rise_m
    place[i, 1, frame + len(rise_m) :] += then_m
    return replace(seen, position_m=place)


def past_foot(seen: Observation) -> int:
    return int(np.argmax(seen.position_m[0, 0] > 0.05))


TURNING = np.array([5e-3, 7e-3, 2e-3, -8e-3])


def test_a_tall_box_that_lies_down_ends_the_track():
    seen = observe(TALL, 0)
    frame = past_foot(seen) + 3
    seen = raised(seen, 0, frame, TURNING, -0.015)
    segments = segment(clip_of(TALL), seen)
    (why,), used = segments.cuts, segments.used(seen)
    assert (why.name, why.side, why.why) == ("object1", "after", TIPS_OVER)
    assert abs(round(why.time_s * FPS) - (frame - 1)) <= 1
    assert not used.mask[:, frame:].any(), "object 2 is hit by another body than was declared"
    assert used.mask[:, : frame - 2].all()


def test_one_that_turns_in_the_foot_itself():
    """It never stands on the table: what is used ends on the ramp."""
    seen = observe(TALL, 1)
    frame = past_foot(seen)
    segments = segment(clip_of(TALL), raised(seen, 0, frame, np.full(1, -8e-3), -0.015))
    (why,), used = segments.cuts, segments.used(seen)
    assert why.why == TIPS_OVER
    assert used.position_m[0, 0][used.mask[0]].max() < -0.02


def test_what_is_hit_may_tip_over():
    seen = observe(TALL, 2)
    frame = int(np.argmax(seen.position_m[1, 0] > 0.26))
    rise = np.array([4e-3, 9e-3, 12e-3, 8e-3, 4e-3])  # a cube goes over its edge, as high as before
    (why,) = segment(clip_of(CUBES), raised(observe(CUBES, 2), 1, frame, rise, 0.0)).cuts
    assert (why.name, why.why) == ("object2", TIPS_OVER)
    assert abs(round(why.time_s * FPS) - frame) <= 3


@pytest.mark.parametrize("experiment", [TALL, CUBES], ids=["tall", "cubes"])
@pytest.mark.parametrize("slope", [0.0, 0.03, -0.03], ids=["level", "rises", "falls"])
def test_what_does_not_tip(experiment, slope):
    """Sliding, on a table that slopes, too; and rocking half as high as an edge."""
    for seed in range(5):
        seen = observe(experiment, seed)
        x = seen.position_m[:, 0]
        seen.position_m[:, 1] += slope * np.where(x > 0, x, 0.0)
        assert segment(clip_of(experiment), seen) == Segments()
        rocks = EDGE_M / 2 * np.array([0.6, 1.0, 0.6])
        seen = raised(seen, 0, past_foot(seen), rocks, 0.0)
        assert segment(clip_of(experiment), seen) == Segments()


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
