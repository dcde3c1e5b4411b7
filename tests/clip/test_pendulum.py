"""Pendulums: the elliptic closed form, dry friction, a thread that stretches, simulate and fit."""

import math
from dataclasses import replace
from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.special import ellipj, ellipk

from galileo_jax.api.fit import fit
from galileo_jax.api.simulate import simulate
from galileo_jax.assembly.build_problem import make_problem
from galileo_jax.assembly.build_scene import build_scene
from galileo_jax.clip.load import load_clip
from galileo_jax.clip.track_csv import read_observation_csv
from galileo_jax.model.effects import make_effects
from galileo_jax.model.parameters import absent
from galileo_jax.rollout.rollout import in_jax
from galileo_jax.runtime.errors import InputError
from tests.precision import in_64_bit

G, L = 9.81, 0.7
EXACT = 1e-9  # of the amplitude
YAML = """\
track: swing.csv
scenario: pendulum
{extra}objects: [{{name: object1, shape: sphere, size_m: [0.02], mass_kg: 0.1}}]
"""


@pytest.fixture(autouse=True)
def precision():
    with in_64_bit():
        yield


def closed_form(time_s: np.ndarray, start_rad: float) -> np.ndarray:
    """The angle of a pendulum that is let go at `start_rad`."""
    k = math.sin(start_rad / 2)
    quarter = ellipk(k**2)
    sn, *_ = ellipj(quarter - math.sqrt(G / L) * time_s, k**2)
    return 2 * np.arcsin(k * sn)


def problem_of(folder: Path, start_rad: float, effects=(), extra="", seconds=8.0):
    """A pendulum with its pivot at (0, 0) and 60 frames a second."""
    times = np.arange(round(60 * seconds)) / 60
    angle = closed_form(times, start_rad)
    rows = [
        f"{t:.6f},{L * math.sin(a):.6f},{-L * math.cos(a):.6f},0.001"
        for t, a in zip(times, angle, strict=True)
    ]
    path = folder / "swing.csv"
    path.write_text("\n".join(["time_s,object1_x_m,object1_y_m,object1_sd_m", *rows]) + "\n")
    path.with_suffix(".yaml").write_text(YAML.format(extra=extra))
    return make_problem(load_clip(path), read_observation_csv(path), "auto", make_effects(effects))


def theta_of(problem, **given: float) -> np.ndarray:
    theta = absent(problem.model.parameters)
    for name, value in {"m1": 0.1, "thread_length": L, "start_speed": 0.0, **given}.items():
        theta[problem.model.index(name)] = value
    return theta


def rolled(problem, **given: float) -> tuple[np.ndarray, np.ndarray]:
    """Times and centres `[axis, record]`."""
    position, _ = problem.engine.simulate(theta_of(problem, **given)[None])
    return np.arange(position.shape[-1]) * problem.model.record_dt_s, position[0, 0]


def angles(position: np.ndarray, start_rad: float, length_m: float = L) -> np.ndarray:
    start = position[:, 0] - length_m * np.array([math.sin(start_rad), -math.cos(start_rad)])
    x, y = position - start[:, None]
    return np.unwrap(np.arctan2(x, -y))


@pytest.mark.parametrize("start_deg", [3.0, 60.0, 170.0])
def test_any_angle_is_the_elliptic_closed_form(start_deg, tmp_path):
    start = math.radians(start_deg)
    times, position = rolled(problem_of(tmp_path, start), start_angle=start)
    assert np.abs(angles(position, start) - closed_form(times, start)).max() < EXACT * start


@pytest.mark.parametrize(
    "effect", ["bearing_friction", "thread_stretch", "rod_mass", "air_drag", "viscous_drag"]
)
def test_strength_zero_is_absent(effect, tmp_path):
    base = rolled(problem_of(tmp_path, 1.0), start_angle=1.0)[1]
    with_it = problem_of(tmp_path, 1.0, [effect])
    count = base.shape[-1]
    assert rolled(with_it, start_angle=1.0)[1][:, :count] == pytest.approx(base, abs=1e-13)
    strength = {"thread_stretch": 0.01}.get(effect, 0.05)
    moved = rolled(with_it, start_angle=1.0, **{effect: strength})[1]
    assert np.abs(moved[:, :count] - base).max() > 0.005


def test_dry_friction_takes_the_same_from_every_swing(tmp_path):
    """Small swings shrink by 2 k each time they turn back, and end where friction holds them."""
    k, start = 0.01, 0.09
    problem = problem_of(tmp_path, start, ["bearing_friction"])
    _, position = rolled(problem, start_angle=start, bearing_friction=k)
    angle = angles(position, start)
    turns = [start] + [start - 2 * k * n for n in range(1, 5)]
    found = [abs(angle[0])]
    found += [abs(angle[i]) for i in np.flatnonzero(np.diff(np.sign(np.diff(angle)))) + 1]
    assert found[:5] == pytest.approx(turns, abs=3e-4)
    assert np.ptp(angle[-60:]) == 0.0
    assert abs(angle[-1]) < k


def test_rates_with_friction_are_right(tmp_path):
    """JAX's slopes against central differences, over turns and to the rest."""
    problem = problem_of(tmp_path, 0.5, ["bearing_friction", "air_drag"], seconds=3.0)
    given = {"start_angle": 0.5, "bearing_friction": 0.03, "air_drag": 0.02}
    theta = jnp.asarray(theta_of(problem, **given))
    roll = in_jax(problem.engine)
    for name in ("thread_length", "start_angle", "bearing_friction", "air_drag"):
        way = np.eye(len(theta))[problem.model.index(name)]
        _, slope = jax.jvp(lambda v: roll(v[None])[0], (theta,), (jnp.asarray(way),))
        high, low = (np.asarray(roll((theta + s * 1e-6 * way)[None])[0]) for s in (1, -1))
        assert np.abs((high - low) / 2e-6 - slope).max() < 1e-5 * (1 + np.abs(slope).max())


def test_a_stiff_thread_is_a_stiff_spring(tmp_path):
    """Against bob and spring with both coordinates, started without vibration."""
    stretch, start = 1e-4, 1.0
    problem = problem_of(tmp_path, start, ["thread_stretch"], seconds=3.0)
    times, position = rolled(problem, start_angle=start, thread_stretch=stretch)

    def change(_: float, y: np.ndarray) -> list[float]:
        r, a, dr, w = y
        pull = G * (r - L) / stretch
        return [dr, w, r * w**2 + G * math.cos(a) - pull, -(G * math.sin(a) + 2 * dr * w) / r]

    first = [L + stretch * math.cos(start), start, 0.0, 0.0]
    found = solve_ivp(
        change, (0, times[-1]), first, t_eval=times, rtol=1e-10, atol=1e-12, method="DOP853"
    )
    exact = found.y[0] * np.array([np.sin(found.y[1]), -np.cos(found.y[1])])
    away = exact - exact[:, :1] - (position - position[:, :1])
    rigid = rolled(problem, start_angle=start)[1]
    assert np.abs(away).max() < 0.02 * np.abs(position - rigid).max()


def test_the_priors_start_near_the_answer(tmp_path):
    scene = problem_of(tmp_path, 0.8).model.scene.surroundings
    assert scene.expected["thread_length"][0] == pytest.approx(L, rel=0.15)
    assert scene.expected["start_angle"][0] == pytest.approx(0.8, abs=0.02)
    told = problem_of(tmp_path, 0.8, extra="pivot_m: [0.0, 0.0]\nthread_m: 0.7\n")
    scene = told.model.scene.surroundings
    assert scene.expected["thread_length"] == (0.7, pytest.approx(0.002 / 0.7))
    assert scene.expected["start_angle"] == (pytest.approx(0.8, abs=1e-3), pytest.approx(0.01 / L))


@pytest.mark.parametrize(
    ("extra", "message"),
    [
        (
            "thread_m: 70.0\n",
            "thread_m: 70 m is not a length of a thread; 0.01 to 30 m .* mean 0.7",
        ),
        ("pivot_m: [0.0]\n", r"pivot_m\[1\]: missing; \[x, y\] expected"),
        ("floor: true\n", "floor: means nothing in scenario pendulum"),
    ],
)
def test_wrong_keys_are_said(extra, message, tmp_path):
    with pytest.raises(InputError, match=message):
        problem_of(tmp_path, 0.8, extra=extra)


def test_a_track_in_space_is_refused(tmp_path):
    problem = problem_of(tmp_path, 0.8)
    path = tmp_path / "swing.csv"
    lines = path.read_text().splitlines()
    lines = [lines[0] + ",object1_z_m", *(line + ",0.0" for line in lines[1:])]
    path.write_text("\n".join(lines) + "\n")
    with pytest.raises(InputError, match="pendulum: a track in the plane"):
        make_problem(load_clip(path), read_observation_csv(path))
    assert problem.observation.position_m.shape[1] == 2


@pytest.mark.parametrize("effect", [None, "bearing_friction"])
def test_simulated_swings_are_the_engines(effect, tmp_path):
    """SciPy's integrator with its events, and the engine with its own."""
    out = tmp_path / "clip.csv"
    effects = [effect] if effect else []
    (truth,) = simulate(
        out, scenario="pendulum", seed=4, track_only=True, track_noise=1e-6, effects=effects
    ).truths
    clip = load_clip(out)
    observation = read_observation_csv(out)
    problem = make_problem(clip, observation, "auto", make_effects(effects))
    given = truth["parameters"]
    seen = problem.simulate(theta_of(problem, **given))
    assert seen == pytest.approx(observation.position_m, abs=1e-5)
    assert build_scene(clip, observation).surroundings.starts_moving


@pytest.mark.slow
@pytest.mark.parametrize(
    "effect", [None, "bearing_friction", "viscous_drag", "air_drag", "thread_stretch"]
)
def test_a_fit_finds_what_was_hidden(effect, tmp_path):
    made = simulate(
        tmp_path / "clip.csv",
        scenario="pendulum",
        seed=5,
        fps=60.0,
        track_only=True,
        track_noise=0.001,
        effects=[effect] if effect else [],
    )
    found = fit(made.clips[0], effects=[effect] if effect else ())
    assert found.result["error"]["chi2_per_dof"] == pytest.approx(1.0, abs=0.3)
    for name, true in made.truths[0]["parameters"].items():
        told = found.result["parameters"][name]
        assert abs(told["mean"] - true) < 4 * told["sd"], name


def test_a_mark_beside_the_thread_turns_the_plumb_line(tmp_path):
    """Of a film: what is 5 px aside seems 5 px over the thread's length out of plumb."""
    table = problem_of(tmp_path, 0.4)
    clip = load_clip(tmp_path / "swing.csv").model_copy(update={"pixels_per_metre": 500.0})
    filmed = replace(read_observation_csv(tmp_path / "swing.csv"), noise_known_to=0.15)
    found = build_scene(clip, filmed).surroundings.expected["declared_angle"]
    assert found == pytest.approx((0.0, 5 / (500 * L)), rel=0.05)  # L by the period
    assert "declared_angle" not in table.model.scene.surroundings.expected
    fitted = make_problem(clip, filmed, "auto", make_effects(()))
    assert "declared_angle" in [parameter.name for parameter in fitted.parameters]
