"""Falls with a floor, flights, springs, liquids: closed forms, two integrators, the commands."""

import json
import math
from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from galileo_jax.api.simulate import simulate
from galileo_jax.assembly.build_problem import make_problem
from galileo_jax.assembly.expected import expected
from galileo_jax.clip.load import load_clip
from galileo_jax.clip.scenarios import SCENARIOS
from galileo_jax.clip.track_csv import read_observation_csv
from galileo_jax.commands import command, compare, diagnose, fit, predict
from galileo_jax.commands import simulate as simulate_command
from galileo_jax.model.effects import effect_names, make_effects
from galileo_jax.model.parameters import Normal, absent
from galileo_jax.results.truth import true_parameters
from galileo_jax.rollout.rollout import in_jax
from galileo_jax.runtime.errors import InputError
from galileo_jax.simulation.free import draw_free, solve_free
from galileo_jax.simulation.plane import PlaneTruth
from tests.precision import in_64_bit

G, MASS_KG, RADIUS_M, FPS, FRAMES = 9.81, 0.05, 0.03, 30, 60
TIMES_S = np.arange(FRAMES) / FPS
EXACT_M = 1e-9
# Runge-Kutta's fourth order at 1/240 s, and what Hermite's cubics make of it between records.
SMOOTH_M = 1e-7
# A bounce lies between two records, which are joined by straight lines.
BOUNCE_M = 5e-5
FREE = ("fall", "flight", "spring", "liquid", "pendulum")


@pytest.fixture(autouse=True)
def precision():
    with in_64_bit():
        yield


def write(folder: Path, scenario: str, y_m: np.ndarray, extra: str = "") -> Path:
    """A csv track that stands at x = 0 and its yaml; returns the csv."""
    path = folder / f"{scenario}.csv"
    rows = [f"{t:.9f},0,{y:.9f},0.001" for t, y in zip(TIMES_S, y_m, strict=True)]
    path.write_text("\n".join(["time_s,object1_x_m,object1_y_m,object1_sd_m", *rows]) + "\n")
    path.with_suffix(".yaml").write_text(
        f"track: {path.name}\nscenario: {scenario}\n{extra}objects:\n"
        f"  - {{name: object1, shape: sphere, size_m: [{RADIUS_M}], mass_kg: {MASS_KG}}}\n"
    )
    return path


def problem_of(path: Path, effects=()):
    return make_problem(load_clip(path), read_observation_csv(path), "auto", make_effects(effects))


def theta_of(problem, **given: float) -> np.ndarray:
    """The parameters `given`, all others absent."""
    theta = absent(problem.model.parameters)
    for name, value in {"m1": MASS_KG, **given}.items():
        theta[problem.model.index(name)] = value
    return theta


def integrated(scenario: str, top_m: float, **values: float) -> np.ndarray:
    """What SciPy makes of the same laws, at the frames."""
    thing = draw_free(np.random.default_rng(0), scenario, {}, False).things[0]
    values = {"m1": MASS_KG, **values}
    motion, _ = solve_free(PlaneTruth(scenario, (thing,), values, ((0.0, top_m),), TIMES_S[-1]))
    return motion.at(TIMES_S).position_m[0]


def bounced_m(height_m: float, e: float) -> np.ndarray:
    """How high a ball is that is dropped from rest: parabolas, each e^2 as high as the last."""
    heights = []
    for time in TIMES_S:
        fall_s = math.sqrt(2 * height_m / G)
        after, speed = time - fall_s, e * G * fall_s
        while after > 2 * speed / G:
            after, speed = after - 2 * speed / G, e * speed
        below = height_m - G * time**2 / 2
        heights.append(below if time < fall_s else speed * after - G * after**2 / 2)
    return np.array(heights)


def test_a_ball_bounces_as_newton_said(tmp_path):
    problem = problem_of(write(tmp_path, "fall", np.ones(FRAMES), "floor: true\n"))
    given = {"floor_height": RADIUS_M, "floor_restitution": 0.7}
    theta = theta_of(problem, **given)
    y = problem.simulate(theta)[0, 1]
    assert y == pytest.approx(RADIUS_M + bounced_m(1 - RADIUS_M, 0.7), abs=BOUNCE_M)
    assert integrated("fall", 1.0, **given)[1] == pytest.approx(y, abs=BOUNCE_M)


@pytest.mark.slow
def test_derivatives_go_through_bounces(tmp_path):
    """JAX's against central differences."""
    problem = problem_of(write(tmp_path, "fall", np.ones(FRAMES), "floor: true\n"))
    given = {"floor_height": RADIUS_M, "floor_restitution": 0.7}
    theta = theta_of(problem, **given)
    roll = in_jax(problem.engine)
    for name in given:
        way = np.eye(len(theta))[problem.model.index(name)]
        _, slope = jax.jvp(lambda v: roll(v[None])[0], (jnp.asarray(theta),), (jnp.asarray(way),))
        high, low = (np.asarray(roll((theta + s * 1e-5 * way)[None])[0]) for s in (1, -1))
        apart = np.abs((high - low) / 2e-5 - slope)
        # At a bounce itself the height has a kink, and a difference reaches over it.
        assert np.quantile(apart, 0.98) < 1e-3


def test_a_throw_is_a_parabola_and_drag_bends_it(tmp_path):
    problem = problem_of(write(tmp_path, "flight", np.zeros(FRAMES)), ["air_drag"])
    vx, vy = 2.0, 5.0
    start = {"start_velocity_x": vx, "start_velocity_y": vy}
    x, y = problem.simulate(theta_of(problem, **start))[0]
    assert x == pytest.approx(vx * TIMES_S, abs=EXACT_M)
    assert y == pytest.approx(vy * TIMES_S - G * TIMES_S**2 / 2, abs=SMOOTH_M)
    # Straight up: v = -u tan(g t / u - atan(v0 / u)), u the terminal speed.
    drag, up = 0.02, 6.0
    given = {"start_velocity_x": 0.0, "start_velocity_y": up, "air_drag": drag}
    _, y = problem.simulate(theta_of(problem, **given))[0]
    u = math.sqrt(MASS_KG * G / drag)
    rising = math.atan(up / u) * u / G > TIMES_S
    turned = math.atan(up / u) - G * TIMES_S[rising] / u
    high = u**2 / G * np.log(np.cos(turned) / math.cos(math.atan(up / u)))
    assert y[rising] == pytest.approx(high, abs=SMOOTH_M)


def test_a_launcher_is_faster_than_the_first_frame(tmp_path):
    """The ball is seen late; where its path had the launcher's angle it was as fast as this."""
    problem = problem_of(write(tmp_path, "flight", np.zeros(FRAMES), "launch_angle_deg: 45.0\n"))
    theta = theta_of(problem, start_velocity_x=2.0, start_velocity_y=1.0)
    model = problem.model
    (law,) = (each for each in model.nuisances if each.name == "start_velocity")
    derived = law.derived(model.by_name(theta), model.scene.surroundings)
    assert derived["launch_speed"][0] == pytest.approx(2.0 * math.sqrt(2.0))
    prior = model.parameters[model.index("launch_angle")].prior
    assert isinstance(prior, Normal)
    assert prior.sd == pytest.approx(math.radians(0.5))


@pytest.mark.parametrize(("period", "records_a_second"), [(0.7, 240), (1.3, 120)])
def test_a_spring_swings_with_its_period(period, records_a_second, tmp_path):
    damping, rest, speed = 0.3, 0.05, 0.2
    w = 2 * math.pi / period
    f = math.sqrt(w**2 - damping**2)
    q = rest + np.exp(-damping * TIMES_S) * (
        -rest * np.cos(f * TIMES_S) + (speed - damping * rest) * np.sin(f * TIMES_S) / f
    )
    problem = problem_of(write(tmp_path, "spring", -q))
    assert problem.model.record_dt_s == pytest.approx(1 / records_a_second)
    given = {"period": period, "damping": damping, "rest": rest, "start_speed": speed}
    theta = theta_of(problem, **given)
    assert problem.simulate(theta)[0, 1] == pytest.approx(-q, abs=SMOOTH_M)
    assert integrated("spring", 0.0, **given)[1] == pytest.approx(-q, abs=SMOOTH_M)
    scene = problem.model.scene.surroundings
    assert scene.expected["period"][0] == pytest.approx(period, rel=0.05)
    derived = {}
    for law in problem.model.nuisances:
        derived |= law.derived(problem.model.by_name(theta), scene)
    assert derived["stiffness"] == (pytest.approx(MASS_KG * w**2), "N/m")
    assert derived["stretch"] == (pytest.approx(G / w**2), "m")


def test_a_liquid_leads_to_the_terminal_speed(tmp_path):
    problem = problem_of(write(tmp_path, "liquid", -0.1 * TIMES_S))
    ratio, drag = 0.3, 0.2
    given = {"density_ratio": ratio, "liquid_drag": drag, "start_speed": 0.0}
    a = G * (1 - ratio) / (1 + ratio / 2)
    terminal = math.sqrt(MASS_KG * G * (1 - ratio) / drag)
    # The scale of speed is that at which drag balances; the added mass makes it take longer.
    sunk = terminal**2 / a * np.log(np.cosh(a * TIMES_S / terminal))
    y = problem.simulate(theta_of(problem, **given))[0, 1]
    assert y == pytest.approx(-sunk, abs=SMOOTH_M)
    assert integrated("liquid", 0.0, **given)[1] == pytest.approx(y, abs=SMOOTH_M)


@pytest.mark.parametrize("scenario", FREE[1:])
def test_what_the_laws_do_is_no_candidate(scenario, tmp_path):
    """Every name stands in the library, and a model with it is refused in one line."""
    path = write(tmp_path, scenario, -0.1 * TIMES_S)
    assert set(SCENARIOS[scenario].without) <= set(effect_names())
    with pytest.raises(InputError, match=f"initial_push has no place in scenario {scenario}"):
        problem_of(path, ["initial_push"])


def test_declared_densities_say_what_floats(tmp_path):
    path = write(tmp_path, "liquid", -0.1 * TIMES_S, "liquid_density: 998.0\n")
    prior = expected(load_clip(path), read_observation_csv(path), RADIUS_M)["density_ratio"]
    assert prior[0] == pytest.approx(998.0 * 4 / 3 * math.pi * RADIUS_M**3 / MASS_KG)
    assert prior[1] < 0.05


@pytest.mark.parametrize(
    ("scenario", "extra", "message"),
    [
        ("spring", "floor: true\n", "floor: means nothing in scenario spring, only in fall, fl"),
        ("fall", "floor: low\n", "floor: 'low' is not a height; metres above the origin, or true"),
        (
            "liquid",
            "liquid_density: 1.0\n",
            r"1 is too small for a liquid; kg/m\^3 expected; did you",
        ),
    ],
)
def test_wrong_keys_are_said(scenario, extra, message, tmp_path):
    path = write(tmp_path, scenario, -0.1 * TIMES_S, extra)
    with pytest.raises(InputError, match=message):
        load_clip(path)


@pytest.mark.parametrize("scenario", FREE)
def test_simulate_writes_a_track_that_loads(scenario, tmp_path):
    out = tmp_path / "clip.csv"
    (truth,) = simulate(out, scenario=scenario, track_only=True, seed=4).truths
    assert load_clip(out).frame_count == truth["frames"]
    assert truth["effect"] == "none"
    assert true_parameters(load_clip(out).path) == truth["parameters"]


@pytest.mark.parametrize("scenario", FREE)
def test_simulate_films_what_loads(scenario, tmp_path):
    out = tmp_path / "clip.mp4"
    simulate(out, scenario=scenario, seed=4, seconds=0.2)
    assert load_clip(out).frame_count == 7


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (["--scenario", "spring", "--floor"], "--floor: there is none in scenario spring"),
        (["--scenario", "spring", "--set", "k1=1"], "--set: spring has no parameter 'k1'; known"),
        (["--scenario", "flight", "--k1", "0.1"], "--k1: of a ramp only, not of scenario flight"),
        (["--set", "period=1"], "--set: no parameter 'period'; known: m1, k1"),
        (
            ["--scenario", "spring", "--effect", "scale_error"],
            "--effect: scale_error has no place in scenario spring",
        ),
    ],
)
def test_wrong_calls_of_simulate_are_said(call, message, tmp_path, capsys):
    out = str(tmp_path / "clip.csv")
    assert command.run(simulate_command.main, [*call, "--track-only", "--out", out]) == 2
    assert message in capsys.readouterr().err


@pytest.mark.slow
@pytest.mark.parametrize("scenario", FREE)
def test_the_commands_go_through(scenario, tmp_path, capsys):
    out, run = tmp_path / "clip.csv", tmp_path / "run"
    made = simulate(
        out,
        scenario=scenario,
        seed=4,
        fps=60.0,
        track_only=True,
        track_noise=0.001,
        floor="floor" in SCENARIOS[scenario].keys,
    )
    assert command.run(fit.main, [str(out), "--out", str(run)]) == 0
    result = json.loads((run / "result.json").read_text())
    assert result["error"]["chi2_per_dof"] == pytest.approx(1.0, abs=0.35)
    truth = made.truths[0]["parameters"]
    for name, true in truth.items():
        told = result["parameters"][name]
        assert abs(told["mean"] - true) < 4 * told["sd"], name
    assert command.run(compare.main, [str(run)]) == 0
    assert command.run(predict.main, [str(run), "--seconds", "1"]) == 0
    assert command.run(diagnose.main, [str(out), "--out", str(tmp_path / "diagnosis")]) == 0
    found = json.loads((tmp_path / "diagnosis" / "diagnosis.json").read_text())
    assert found["verdict"]["status"] == "none"


def test_the_strength_of_what_is_hidden_counts_without_a_ramp(tmp_path):
    found = []
    for strength in (0.0, 1.0):
        path = tmp_path / f"fall{strength:g}.csv"
        given = {"scenario": "fall", "track_only": True, "effects": ["air_drag"], "seed": 1}
        (truth,) = simulate(path, strength=strength, **given).truths
        found.append(truth["effect_parameters"]["air_drag"])
    assert found[1] > 2 * found[0]
