"""A blow on a puck without a partner ends the clip; hits and declared walls do not."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import yaml

import galileo_jax as gx
from galileo_jax.clip.schema import Clip
from galileo_jax.measurement.in_metres import observed
from galileo_jax.measurement.measure import measure
from galileo_jax.measurement.segments.foreign_impact import stranger_frame
from galileo_jax.measurement.segments.segments import RESTS, STRUCK
from galileo_jax.numerics.line_segments import nearest_frames

FPS = 120.0


def made(folder: Path, seed: int) -> Clip:
    path = folder / f"pucks_{seed}.csv"
    gx.simulate(path, scenario="from_above", seed=seed, track_only=True, fps=FPS, walls=True)
    return gx.load(path)


@pytest.mark.parametrize("seed", [611, 612, 613])
def test_a_wall_that_nobody_declared_ends_the_clip(tmp_path: Path, seed: int) -> None:
    clip = made(tmp_path, seed)
    whole = measure(clip)
    assert {one.why for one in whole.cuts} <= {RESTS}
    seen = whole.whole
    first = min(
        frame
        for i, item in enumerate(clip.objects)
        for wall in clip.walls
        for frame in nearest_frames(
            seen.position_m[i, :2], seen.mask[i], wall.ends_m, (item.size_m or (0.0,))[0]
        )
    )
    at = clip.path
    content = yaml.safe_load(at.read_text())
    del content["walls"]
    at.write_text(yaml.safe_dump(content))
    (found,) = measure(gx.load(at)).cuts
    assert found.why == STRUCK and found.side == "after"
    assert -3.5 / FPS < found.time_s - first / FPS < 4.5 / FPS


def test_a_hand_that_pushes_a_puck_at_rest_ends_the_clip(tmp_path: Path) -> None:
    clip = made(tmp_path, 611)
    seen, _ = observed(clip)
    times, place = seen.times_s, seen.position_m.copy()
    place[1] = place[1][:, :1]  # it lies far from all, until somebody pushes it
    place[1, 0] += 5.0 + np.where(times > 0.4, 0.8 * (times - 0.4), 0.0)
    place[0] = place[0][:, :1]
    found = stranger_frame(clip, replace(seen, position_m=place))
    assert found is not None and found[1] == 1
    assert abs(found[0] / FPS - 0.4) < 2.5 / FPS
