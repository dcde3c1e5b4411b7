"""k1 of ramps drawn by eye: benchmarks/marks.py at small size."""

import importlib
from pathlib import Path

import numpy as np
import pytest

import galileo_jax as gx

SCRIPTS = Path(__file__).resolve().parents[2] / "benchmarks"
NUM_CLIPS = 8
# Of so many z the rms is outside in one of a hundred draws.
RMS_RANGE = (0.41, 1.66)


def test_k1_of_a_drawn_ramp_is_as_good_as_it_says(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.syspath_prepend(SCRIPTS)
    marks = importlib.import_module("marks")
    zs, exact = [], []
    for seed in range(5000, 5000 + NUM_CLIPS):
        track, truth = marks.drawn_clip(tmp_path, seed)
        found = gx.fit(track).parameters["k1"]
        zs.append((found["mean"] - truth["k1"]) / found["sd"])
        if len(exact) < 2:
            marks.take_as_exact(track)
            taken = gx.fit(track).parameters["k1"]
            exact.append(found["sd"] / taken["sd"])
    assert RMS_RANGE[0] < np.sqrt(np.mean(np.square(zs))) < RMS_RANGE[1]
    assert min(exact) > 2
