"""A board that sags: a disc that rolls on it and comes back, against SciPy and by the fit."""

import math
from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from galileo_jax.api.fit import fit
from galileo_jax.assembly.build_problem import make_problem
from galileo_jax.clip.load import load_clip
from galileo_jax.measurement.measure import measure

G, FPS, NOISE_M, BETA = 9.81, 60.0, 3e-4, 0.5
LENGTH_M, RADIUS_M = 1.2, 0.03
TOP, END = math.radians(7.0), math.radians(-6.0)  # slopes at both ends: a valley


def rolled(seconds: float, rest_s: float) -> tuple[np.ndarray, np.ndarray]:
    """Times, and centres `[2, frame]` of a disc that rolls in a circular valley and comes back."""

    def change(_: float, y: np.ndarray) -> list[float]:
        q, v = y[:2]
        slope = TOP + (END - TOP) * q / LENGTH_M
        return [v, G * math.sin(slope) / (1 + BETA), v * math.cos(slope), -v * math.sin(slope)]

    times = np.arange(round(seconds * FPS)) / FPS
    late = np.maximum(times - rest_s, 0.0)
    found = solve_ivp(change, (0, late[-1]), np.zeros(4), t_eval=late[late > 0], rtol=1e-10)
    return times, np.hstack([np.zeros((2, (late == 0).sum())), found.y[2:]])


def write(folder: Path, angle: str = "null", rest_s: float = 1.0, seed: int = 5) -> Path:
    """The disc's csv and yaml; returns the yaml."""
    times, place = rolled(5.5, rest_s)
    place = place + NOISE_M * np.random.default_rng(seed).standard_normal(place.shape)
    rows = [f"{t:.6f},{x:.7f},{y:.7f},{NOISE_M}" for t, x, y in zip(times, *place, strict=True)]
    head = "time_s,object1_x_m,object1_y_m,object1_sd_m"
    (folder / "disc.csv").write_text("\n".join([head, *rows]) + "\n")
    path = folder / "disc.yaml"
    path.write_text(
        f"track: disc.csv\nscenario: incline\nramp_angle_deg: {angle}\nobjects:\n"
        f"  - {{name: object1, shape: cylinder, size_m: [{RADIUS_M}, 0.02], rolls: true}}\n"
    )
    return path


def test_the_model_rolls_back_as_scipy_says(tmp_path):
    measured = measure(load_clip(write(tmp_path)))
    problem = make_problem(measured.clip, measured.observation)
    scene = problem.model.scene.surroundings
    assert not measured.cuts
    slope = scene.expected["board_slope_1"][0]
    assert slope == pytest.approx((END - TOP) / 2, rel=0.1)
    theta = problem.model.by_name(np.zeros(len(problem.model.names)))
    given = {name: scene.expected[name][0] for name in theta if name.startswith("board_slope")}
    given |= {"m1": 0.1, "k1": 0.3, "foot_transition": 1.0, "release_instant": 1.0}
    vector = np.array([given.get(name, 0.0) for name in problem.model.names])
    predicted = problem.simulate(vector)[0]
    start = measured.observation.position_m[0][:, :1]
    _, true = rolled(5.5, 1.0)
    # The slopes are the noisy path's: the way there and back is met to two hundredths of it.
    assert np.abs(predicted - start - true).max() < 0.02 * true[0].max()


@pytest.mark.slow
def test_a_valley_is_fitted_to_the_noise(tmp_path):
    found = fit(load_clip(write(tmp_path)), seed=1)
    assert found.result["error"]["chi2_per_dof"] == pytest.approx(1.0, abs=0.2)
    release = found.result["nuisances"]["release_instant"]
    assert abs(release["mean"] - 1.0) < 3 * release["sd"] + 0.5 / FPS


def test_a_straight_path_has_no_shape(tmp_path):
    path = write(tmp_path)
    lines = (tmp_path / "disc.csv").read_text().splitlines()
    straight = [line.split(",") for line in lines[1:]]
    rows = [f"{t},{x},{-0.2 * float(x)},{sd}" for t, x, _, sd in straight]
    (tmp_path / "disc.csv").write_text("\n".join([lines[0], *rows]) + "\n")
    measured = measure(load_clip(path))
    problem = make_problem(measured.clip, measured.observation)
    assert not [name for name in problem.model.names if name.startswith("board_slope")]


def test_what_never_slips_does_not_tell_its_friction(tmp_path):
    """A side valley, where it slips for an instant at the release, would tell it to a per cent."""
    told = fit(load_clip(write(tmp_path)), seed=0).result["parameters"]["k1"]
    assert not told["identified"] and told["q975"] > 0.3
