"""How far camera and tracker wander, from the track alone."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from galileo_jax.clip.load import load_clip
from galileo_jax.measurement.measure import measure
from galileo_jax.measurement.wander_size import IN_SPACE_S, LARGEST_M, LASTS_S, with_wander
from galileo_jax.observation.observation import Observation
from galileo_jax.similarity.gaussian_likelihood import whitening_in
from tests.measurement.seen import seen
from tests.ramp_model import HIT, make_surroundings

SD_M = 1e-5


def pucks(wander_m: float, seed: int, frames: int = 70, fps: float = 60.0) -> Observation:
    """A puck that slides and hits another, with errors and wander."""
    rng = np.random.default_rng(seed)
    times = np.arange(frames) / fps
    hit = times[min(15, frames - 1)]
    before, since = np.minimum(times, hit), np.maximum(times - hit, 0)
    slid = 1.5 * before - before**2
    gone = np.where(since < 0.5, 0.8 * since - 0.8 * since**2, 0.2)
    place = np.zeros((2, 2, frames))
    place[0, 0] = slid + 0.3 * gone
    place[1, 0] = slid[-1] + 0.04 + gone
    apart = np.abs(times[:, None] - times)
    root = np.linalg.cholesky(np.exp(-apart / LASTS_S) + 1e-12 * np.eye(frames))
    place += wander_m * (rng.standard_normal(place.shape) @ root.T)
    place += SD_M * rng.standard_normal(place.shape)
    return seen(place, times, SD_M)


@pytest.mark.parametrize("wander_m", [3e-5, 2e-4])
def test_the_wander_is_found(wander_m: float) -> None:
    found = [with_wander(pucks(wander_m, seed)).wander_m or 0.0 for seed in range(4)]
    assert np.mean(found) == pytest.approx(wander_m, rel=0.3)


def test_what_does_not_wander_is_said_to_be_still() -> None:
    found = with_wander(pucks(0.0, 9)).wander_m
    assert found is not None
    assert found < SD_M


def test_a_track_that_is_too_short_tells_nothing() -> None:
    assert with_wander(pucks(0.0, 9, frames=5)).wander_m == LARGEST_M


@pytest.mark.parametrize("wander_m", [5e-5, 5e-4])
def test_that_of_a_tossed_box_is_found_too(wander_m: float) -> None:
    found = [with_wander(tossed(wander_m, seed)).wander_m or 0.0 for seed in range(12)]
    assert np.sqrt(np.mean(np.square(found))) == pytest.approx(wander_m, rel=0.35)


def tossed(wander_m: float, seed: int, frames: int = 40) -> Observation:
    """A box in free flight, in space."""
    rng = np.random.default_rng(seed)
    times = np.arange(frames) / 148
    place = np.stack([1.1 * times, 0.5 * times - 4.9 * times**2, 0.2 * times])[None]
    apart = np.abs(times[:, None] - times)
    root = np.linalg.cholesky(np.exp(-apart / IN_SPACE_S) + 1e-12 * np.eye(frames))
    place = place + wander_m * (rng.standard_normal(place.shape) @ root.T)
    place += SD_M * rng.standard_normal(place.shape)
    return seen(place, times, SD_M)


def test_a_toss_has_its_own_and_a_ball_in_space_that_of_all(tmp_path: Path) -> None:
    """Its poses scatter by 0.01 mm: a wander of 2 mm would hide how fast it falls."""
    box = tossed(0.0, 3)
    places = [
        (t, x, z, y + 0.5) for t, x, y, z in zip(box.times_s, *box.position_m[0], strict=True)
    ]
    poses = [",".join(f"{value:.7f}" for value in (*row, 1, 0, 0, 0)) for row in places]
    head = "time_s,x_m,y_m,z_m"
    (tmp_path / "toss.csv").write_text("\n".join([head + ",qw,qx,qy,qz", *poses]) + "\n")
    flown = [",".join(f"{value:.7f}" for value in row) for row in places]
    (tmp_path / "flight.csv").write_text("\n".join([head, *flown]) + "\n")
    found = {}
    for name, thing in {
        "toss": "shape: box, size_m: [0.1, 0.1, 0.1]",
        "flight": "shape: sphere, size_m: [0.02]",
    }.items():
        path = tmp_path / f"{name}.yaml"
        path.write_text(
            f"track: {name}.csv\ntrack_up: z\nscenario: {name}\nobjects:\n"
            f"  - {{name: object1, {thing}, mass_kg: 0.3}}\n"
        )
        found[name] = measure(load_clip(path)).observation.wander_m
    assert found["toss"] is not None and found["toss"] < 1e-4
    assert found["flight"] is None


@pytest.mark.parametrize("wander_m", [None, 1e-5])
def test_in_space_the_likelihood_takes_what_the_track_tells(wander_m: float | None) -> None:
    """A fall that is 2 % slower than it should be is hidden by 2 mm of wander, and not by 0.01."""
    fall = replace(tossed(0.0, 0), wander_m=wander_m)
    box = make_surroundings(replace(HIT, object2_x_m=None))
    scene = replace(box, has_table=False, has_surface=False, moves_in_plane=True)
    data = whitening_in(fall, scene)
    slow = np.zeros_like(fall.position_m)
    slow[0, 1] = 0.1 * fall.times_s**2
    chi2 = float(np.sum(data.whiten_batch(slow, 1.0) ** 2))
    assert (chi2 > 100) == (wander_m is not None), chi2
