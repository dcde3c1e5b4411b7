"""Flights in space: reading them, the errors that nobody stated, spin, and the Magnus force."""

import math
from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from galileo_jax.assembly.build_problem import make_problem
from galileo_jax.clip.load import load_clip
from galileo_jax.clip.track_csv import read_observation_csv, write_observation_csv
from galileo_jax.measurement.measure import measure
from galileo_jax.model.effects import make_effects
from galileo_jax.model.effects.air import AIR_KG_M3
from galileo_jax.runtime.errors import InputError
from tests.precision import in_64_bit

MASS_KG, RADIUS_M, LIFT, DRAG_KG_M = 0.0027, 0.02, 1.1, 3.5e-4
SPIN = np.array([150.0, -90.0, 60.0])  # x, y (up), z
SD_M, SD_S = 5e-4, 5e-4
START = np.array([0.3, 2.0, -7.0])


@pytest.fixture(autouse=True)
def precision():
    with in_64_bit():
        yield


def flown(times_s: np.ndarray) -> np.ndarray:
    """What SciPy makes of drag and the Magnus force, `[3, row]`, y up."""
    size = LIFT * 0.5 * AIR_KG_M3 * math.pi * RADIUS_M**3

    def change(_: float, state: np.ndarray) -> np.ndarray:
        v = state[3:]
        turned, speed = np.cross(SPIN, v), np.linalg.norm(v)
        lift = size * turned / (1 + 2 * RADIUS_M * np.linalg.norm(turned) / speed**2)
        force = lift - DRAG_KG_M * speed * v
        return np.concatenate([v, force / MASS_KG + [0, -9.81, 0]])

    begin = np.concatenate([[0.1, 0.4, 0.9], START])
    return solve_ivp(change, (0, times_s[-1]), begin, t_eval=times_s, rtol=1e-11).y[:3]


def write(folder: Path, more: str = "", seed: int = 0) -> Path:
    """A flight with irregular times that are half a millisecond off: z up; returns the yaml."""
    rng = np.random.default_rng(seed)
    times = np.cumsum(rng.uniform(0.005, 0.01, 60))
    times -= times[0]
    x, y, z = flown(times) + SD_M * rng.standard_normal((3, 60))
    told = times + np.append(0.0, SD_S * rng.standard_normal(59))
    rows = [f"{t:.5f},{a:.5f},{b:.5f},{c:.5f}" for t, a, b, c in zip(told, x, -z, y, strict=True)]
    (folder / "flight.csv").write_text("\n".join(["time_s,x_m,y_m,z_m", *rows]) + "\n")
    path = folder / "flight.yaml"
    path.write_text(
        "track: flight.csv\ntrack_up: z\nscenario: flight\nobjects:\n  - {name: object1, "
        f"shape: sphere, size_m: [{RADIUS_M}], mass_kg: {MASS_KG}{more}}}\n"
    )
    return path


def test_the_model_flies_as_scipy_says(tmp_path):
    measured = measure(load_clip(write(tmp_path)))
    assert not measured.cuts
    effects = make_effects(["air_drag", "magnus"])
    problem = make_problem(measured.clip, measured.observation, effects=effects)
    names = [f"{of}_{axis}" for of in ("start_velocity", "magnus") for axis in "xyz"]
    given = dict(zip(names, [*START, *SPIN], strict=True))
    given |= {"magnus_lift": LIFT, "air_drag": DRAG_KG_M, "m1": MASS_KG}
    theta = np.array([given.get(name, 0.0) for name in problem.model.names])
    predicted = problem.simulate(theta)[0]
    true = flown(measured.observation.times_s)
    moved = predicted - predicted[:, :1] - true + true[:, :1]
    assert np.abs(moved).max() < 1e-6


def test_errors_along_the_velocity_are_told_from_those_across(tmp_path):
    seen = measure(load_clip(write(tmp_path))).observation
    values = np.linalg.eigvalsh(np.moveaxis(seen.covariance_m2[0], -1, 0))
    assert np.sqrt(values[30, :2]) == pytest.approx(SD_M, rel=0.3)
    assert np.sqrt(values[30, 2]) == pytest.approx(SD_S * 7.0, rel=0.4)
    out = tmp_path / "again.csv"
    write_observation_csv(out, seen)
    again = read_observation_csv(out)
    assert again.position_m == pytest.approx(seen.position_m, abs=0)
    assert again.covariance_m2 == pytest.approx(seen.covariance_m2, abs=1e-12)


def test_a_measured_spin_is_the_prior(tmp_path):
    spin = [150.0, -60.0, -90.0]
    measured = measure(load_clip(write(tmp_path, f", spin_rad_s: {spin}")))
    effects = make_effects(["magnus"])
    problem = make_problem(measured.clip, measured.observation, effects=effects)
    means = [
        parameter.prior.mean  # pyright: ignore[reportAttributeAccessIssue]
        for parameter in problem.model.parameters
        if parameter.name in ("magnus_x", "magnus_y", "magnus_z")
    ]
    assert means == pytest.approx(SPIN)


def test_the_drag_of_the_air_is_expected(tmp_path):
    measured = measure(load_clip(write(tmp_path)))
    (effect,) = effects = make_effects(["air_drag"])
    problem = make_problem(measured.clip, measured.observation, effects=effects)
    scene = problem.model.scene.surroundings
    assert effect.odds({"air_drag": np.array(DRAG_KG_M)}, scene) > 10
    assert effect.odds({"air_drag": np.array(30 * DRAG_KG_M)}, scene) < 1.5


def test_what_is_wrong_is_one_line(tmp_path):
    path = write(tmp_path, ", spin_rad_s: [1.0, 2.0]")
    with pytest.raises(
        InputError, match=r"spin_rad_s: \[1.0, 2.0\] has 2 values; \[x, y, z\] in rad/s"
    ):
        load_clip(path)
    path = write(tmp_path)
    table = tmp_path / "flight.csv"
    rows = table.read_text().splitlines()
    table.write_text("\n".join([rows[0], rows[2], rows[1], *rows[3:]]))
    with pytest.raises(InputError, match="times must increase"):
        load_clip(path)
    table.write_text("\n".join(",".join(row.split(",")[:3]) for row in rows))
    with pytest.raises(InputError, match="track_up: z, but flight"):
        load_clip(path)


@pytest.mark.parametrize("scenario", ["fall", "spring", "liquid", "level", "incline"])
def test_what_keeps_to_a_line_is_not_seen_in_space(tmp_path, scenario):
    path = write(tmp_path)
    more = "\nramp_angle_deg: 20" if scenario == "incline" else ""
    text = path.read_text().replace("track_up: z\nscenario: flight", f"scenario: {scenario}{more}")
    path.write_text(text)
    with pytest.raises(InputError, match=f"'z_m': means nothing in scenario {scenario}"):
        measure(load_clip(path))
