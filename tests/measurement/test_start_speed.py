"""Whether an object moves already when it is first seen, and how fast."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from galileo_jax.api.fit import fit
from galileo_jax.assembly.build_problem import make_problem
from galileo_jax.clip.load import load_clip
from galileo_jax.measurement.measure import measure
from galileo_jax.measurement.segments.start_speed import rest_s, start_speed
from galileo_jax.observation.observation import Observation
from tests.measurement.seen import seen

FPS, NOISE_M, A_M_S2 = 60.0, 5e-4, 2.4
DOWN = np.array([np.cos(0.4), -np.sin(0.4)])


def went(way_m: np.ndarray, seed: int = 0) -> Observation:
    return seen(way_m * DOWN[:, None], np.arange(len(way_m)) / FPS, NOISE_M, seed)


def way(release_s: float, drag_per_s: float = 0.0, count: int = 60) -> np.ndarray:
    """From rest at `release_s`, as seen from t = 0 on; x'' = a - drag x'."""
    after = np.maximum(np.arange(count) / FPS - release_s, 0.0)
    if not drag_per_s:
        return A_M_S2 * after**2 / 2
    return A_M_S2 / drag_per_s * (after + np.expm1(-drag_per_s * after) / drag_per_s)


@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize("before_s", [0.1, 0.4])
@pytest.mark.parametrize("drag_per_s", [0.0, 1.0])
def test_what_was_let_go_before_moves(before_s, drag_per_s, seed):
    found = start_speed(went(way(-before_s, drag_per_s), seed))
    at_first = way(0.0, drag_per_s, 60)
    true = np.interp(before_s, np.arange(60) / FPS, np.gradient(at_first, 1 / FPS))
    assert found is not None
    assert abs(found.mean_m_s - true) < 4 * found.sd_m_s < 0.2


@pytest.mark.parametrize("seed", range(10))
@pytest.mark.parametrize("release_s", [-0.005, 0.0, 0.01, 0.3])
@pytest.mark.parametrize("drag_per_s", [0.0, 1.0, 4.0])
def test_what_is_let_go_in_the_clip_does_not(release_s, drag_per_s, seed):
    assert start_speed(went(way(release_s, drag_per_s, 90), seed)) is None


@pytest.mark.parametrize("seed", range(5))
def test_a_brake_on_the_way_is_no_start_in_motion(seed):
    """A magnet from .35 to .55 m."""
    time = np.arange(0.0, 1.2, 1e-4)
    place, speed = np.zeros(len(time)), np.zeros(len(time))
    for i in range(len(time) - 1):
        brake = 4.0 * speed[i] * (0.35 < place[i] < 0.55)
        speed[i + 1] = speed[i] + 1e-4 * (A_M_S2 - brake)
        place[i + 1] = place[i] + 1e-4 * speed[i]
    assert start_speed(went(np.interp(np.arange(70) / FPS, time, place), seed)) is None


@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize("held_s", [0.0, 0.5])
def test_what_goes_up_first_moves_against_the_way(held_s, seed):
    """Pushed up a slope at 1.2 m/s before the clip or in it, and slides down again."""
    time = np.maximum(np.arange(120) / FPS - held_s, 0.0)
    found = start_speed(went(-1.2 * time + A_M_S2 * time**2 / 2, seed))
    if held_s:
        assert found is None
    else:
        assert found is not None
        assert abs(found.mean_m_s + 1.2) < 4 * found.sd_m_s < 0.4


def test_rest_and_too_few_places_tell_nothing():
    assert start_speed(went(np.zeros(60))) is None
    assert start_speed(went(way(-0.4, count=6))) is None


def write_fall(folder: Path, before_s: float, more: str = "") -> Path:
    """A fall from rest that began `before_s` before the first row of its table."""
    times = np.arange(24) / FPS
    noise = 3e-4 * np.random.default_rng(3).standard_normal((2, len(times)))
    y = 1.5 - 9.81 * (times + before_s) ** 2 / 2 + noise[1]
    rows = [f"{t:.6f},{x:.6f},{h:.6f},3e-4" for t, x, h in zip(times, noise[0], y, strict=True)]
    head = "time_s,object1_x_m,object1_y_m,object1_sd_m"
    (folder / "fall.csv").write_text("\n".join([head, *rows]) + "\n")
    path = folder / "fall.yaml"
    path.write_text(
        f"track: fall.csv\nscenario: fall\n{more}objects: [{{name: object1, shape: sphere}}]\n"
    )
    return path


@pytest.mark.parametrize("before_s", [0.0, 1 / 60, 0.05, 0.2])
def test_gravity_does_not_depend_on_when_the_clip_begins(tmp_path, before_s):
    clip = load_clip(write_fall(tmp_path, before_s))
    found = fit(clip, free=["gravity"])
    gravity = found.parameters["gravity"]
    assert abs(gravity["mean"] - 9.81) < 4 * gravity["sd"] < 0.3
    assert found.result["error"]["chi2_per_dof"] < 2


def test_it_is_said_and_can_be_declared_otherwise(tmp_path):
    measured = measure(load_clip(write_fall(tmp_path, 0.1)))
    assert measured.clip.starts_moving
    assert any("moves already in the first frame that is used, at " in r for r in measured.remarks)
    at_rest = measure(load_clip(write_fall(tmp_path, 0.1, "starts_moving: false\n")))
    assert at_rest.clip.starts_moving is False and not at_rest.remarks


def test_no_data_lie_behind_a_rollout(tmp_path):
    """However early the release may be."""
    measured = measure(load_clip(write_fall(tmp_path, 0.0)))
    model = make_problem(measured.clip, measured.observation).model
    release_s, sd_s = model.scene.surroundings.release_s
    assert model.duration_s >= measured.observation.times_s[-1] - (release_s - 5 * sd_s)


@pytest.mark.parametrize("rests", [0.2, 0.6])
def test_a_picture_that_a_coder_froze_does_not_hide_a_rest(rests):
    """Its own errors are next to nothing, and one that many frames share moves it by more."""
    off_m = 4 * NOISE_M  # more than the frames after the rest scatter
    seen_way = went(way(rests, count=120))
    frozen = round(rests * FPS)
    place, covariance = seen_way.position_m.copy(), seen_way.covariance_m2.copy()
    place[..., :frozen] = place[..., :1] - off_m * (np.arange(frozen) > 3) * DOWN[:, None]
    covariance[..., :frozen] *= 1e-6
    lasting = np.zeros(place.shape)
    lasting[0, :, 4:frozen] = off_m * DOWN[:, None]
    seen_way = replace(seen_way, position_m=place, covariance_m2=covariance)
    found = rest_s(seen_way.with_modes([], [lasting]))
    assert found is not None and abs(found - rests) < 0.05


@pytest.mark.parametrize(
    ("rows", "before_s", "moves"),
    [(9, 0.08, True), (8, 0.12, True), (40, -0.15, False), (12, -0.15, False)],
)
def test_a_short_table_may_begin_after_the_release(tmp_path, rows, before_s, moves):
    """Too few rows to be sure: whichever is likelier is what the fit assumes."""
    times = np.arange(rows) / 30
    height = 1.5 - 9.81 / 2 * np.maximum(times + before_s, 0) ** 2
    found = []
    for seed in range(6):
        noise = np.random.default_rng(seed).normal(0, 2e-3, rows)
        table = np.column_stack([times, height + noise])
        np.savetxt(tmp_path / "fall.csv", table, "%.4f", ",", header="t (s),y (m)", comments="")
        (tmp_path / "fall.yaml").write_text(
            "track: fall.csv\nscenario: fall\nobjects:\n- {name: ball, shape: sphere}\n"
        )
        found.append(measure(load_clip(tmp_path / "fall.yaml")).clip.starts_moving)
    wrong = sum((one is True) != moves for one in found)
    assert wrong == 0 if moves else wrong <= 1, found
