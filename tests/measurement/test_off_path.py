"""Places beside a path that goes on without them; and none where something happens to it."""

from pathlib import Path

import numpy as np
import pytest

from galileo_jax.clip.load import load_clip
from galileo_jax.measurement.measure import measure
from galileo_jax.measurement.segments.off_path import off_path, on_path
from galileo_jax.observation.observation import Observation

T = np.arange(60) / 50
SLIDE = np.stack([0.9 * T**2, -0.4 * T**2])
THROW = np.stack([2.5 * T, 3.3 * T - 4.905 * T**2])
SWING = 0.9 * np.stack([np.sin(0.35 * np.cos(3.3 * T)), -np.cos(0.35 * np.cos(3.3 * T))])
STOPS = np.stack([np.minimum(1.2 * T, 0.73), 0 * T])
BOUNCES = np.stack([0.6 * T, np.abs(0.7 - 1.1 * T)])
LEAVES = np.stack([0.5 * np.maximum(T - 0.6, 0) ** 2, 0 * T])  # from rest
JOLT = np.stack([1.5 * T - 0.4 * np.maximum(T - 0.5, 0), 0 * T])  # loses speed in a hit


def seen(place_m: np.ndarray, noise_m: float = 5e-4, seed: int = 0) -> Observation:
    noisy = place_m + noise_m * np.random.default_rng(seed).standard_normal(place_m.shape)
    cover = noise_m**2 * np.eye(2)[None, :, :, None] * np.ones(len(T))
    return Observation(("object1",), T, noisy[None], cover, np.ones((1, len(T)), bool))


@pytest.mark.parametrize("path", [SLIDE, THROW, SWING], ids=["slide", "throw", "swing"])
@pytest.mark.parametrize("rows", [[30], [20, 40], [24, 26], list(range(25, 33))])
def test_what_lies_beside_a_path_is_found_to_the_row(path, rows):
    """Elsewhere, or where it was: a tracker that sticks to what is behind it."""
    elsewhere, stuck = path.copy(), path.copy()
    elsewhere[:, rows] += [[0.2], [0.1]]
    stuck[:, rows] = path[:, rows[0] - 1, None]
    moved = np.linalg.norm(np.diff(path[:, rows[0] - 1 : rows[0] + 1]))
    for place in [elsewhere, stuck] if moved > 0.015 else [elsewhere]:
        assert np.flatnonzero(off_path(seen(place))[0]).tolist() == rows


@pytest.mark.parametrize("noise_m", [2e-5, 5e-4, 4e-3])
@pytest.mark.parametrize(
    "path", [SLIDE, THROW, SWING, STOPS, BOUNCES, LEAVES, JOLT],
    ids=["slide", "throw", "swing", "stops", "bounces", "leaves", "jolt"],
)  # fmt: skip
def test_what_happens_to_a_path_is_no_place_beside_it(path, noise_m):
    for seed in range(5):
        assert not off_path(seen(path, noise_m, seed)).any()


def test_a_change_after_places_beside_it_is_left_to_others():
    """It does not go on as before: nobody can tell which of them are right."""
    place = BOUNCES.copy()
    place[:, 28:36] += 0.3
    found, said = on_path(seen(place))
    assert found.mask.all() and said == ()


def test_a_table_is_read_without_them_and_says_so(tmp_path: Path):
    place = seen(SLIDE).position_m[0].copy()
    place[:, 30] += 0.25
    rows = "\n".join(f"{t:.3f},{x:.4f},{y:.4f}" for t, x, y in zip(T, *place, strict=True))
    (tmp_path / "a.csv").write_text(f"time_s,x_m,y_m\n{rows}\n")
    (tmp_path / "a.yaml").write_text(
        "track: a.csv\nscenario: incline\nramp_angle_deg: 23.96\n"
        "objects: [{name: object1, shape: box}]\n"
    )
    found = measure(load_clip(tmp_path / "a.yaml"))
    assert not found.observation.mask[0, 30] and found.observation.mask[0].sum() == 59
    assert not found.cuts and found.doubts == ()
    [line] = [one for one in found.remarks if "beside" in one]
    assert "object1: a place lies beside its path (0.600 s), which goes on without it" in line
