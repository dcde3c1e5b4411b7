"""A box that tips over ends the track; one that rocks, or a table that slopes, does not."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from galileo_jax.clip.schema import Clip, ClipObject
from galileo_jax.measurement.segments.ramp_ends import TIPS_OVER
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
