"""Frames after the last one that counts are not used, of a track as of a video."""

import galileo_jax as gx
from galileo_jax.clip.load import load_clip
from galileo_jax.measurement.measure import measure


def test_a_track_ends_with_its_last_frame(tmp_path):
    gx.simulate(tmp_path / "slide.csv", scenario="incline", seed=1, track_only=True)
    gx.label(tmp_path / "slide.csv", last_frame={"object1": 8})
    seen = measure(load_clip(tmp_path / "slide.csv")).observation.mask[0]
    assert seen[:9].all()
    assert not seen[9:].any()
