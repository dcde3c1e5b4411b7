"""The scenario `fall`: closed forms, what has a place in it, and what is refused."""

import json
import math
from pathlib import Path

import numpy as np
import pytest

from galileo_jax.assembly.build_problem import make_joint_problem, make_problem
from galileo_jax.clip.checks import check_same_objects
from galileo_jax.clip.load import load_clip
from galileo_jax.clip.track_csv import read_observation_csv
from galileo_jax.commands import command, diagnose, fit
from galileo_jax.model.effects import effect_names, make_effects
from galileo_jax.model.model import MASS_PRIOR
from galileo_jax.model.parameters import LogNormal, absent
from galileo_jax.rollout.engines import make_engine
from galileo_jax.runtime.errors import InputError
from tests.precision import in_64_bit

G, MASS_KG, RELEASE_S, TOP_M = 9.81, 0.05, 0.1, 3.0
FPS, FRAMES, NOISE_M = 30, 50, 0.003
HAS_A_PLACE = {
    "added_mass",
    "air_drag",
    "constant_force",
    "frame_rate",
    "initial_push",
    "release_delay",
    "scale_error",
    "spring_tether",
    "viscous_drag",
}
EXACT_M = 1e-9
# The rigid engine is second order in its step of 1/240 s for laws that depend on the speed.
DRAG_M = 2e-4


@pytest.fixture(autouse=True)
def precision():
    with in_64_bit():
        yield


def fallen_m(time_s: np.ndarray, drag_kg_m: float = 0.0) -> np.ndarray:
    """How far a ball let go at `RELEASE_S` has fallen: g t^2 / 2, or v^2/g ln cosh(g t / v)."""
    t = np.clip(time_s - RELEASE_S, 0.0, None)
    if not drag_kg_m:
        return 0.5 * G * t**2
    terminal = math.sqrt(MASS_KG * G / drag_kg_m)
    return terminal**2 / G * np.log(np.cosh(G * t / terminal))


def write_fall(
    folder: Path,
    name: str = "drop",
    drag_kg_m: float = 0.0,
    noise_m: float = NOISE_M,
    mass: str = f"mass_kg: {MASS_KG}",
) -> Path:
    """A csv track of a ball and its yaml; returns the csv."""
    time_s = np.arange(FRAMES) / FPS
    rng = np.random.default_rng(5)
    y = TOP_M - fallen_m(time_s, drag_kg_m) + noise_m * rng.standard_normal(FRAMES)
    rows = [f"{t:.9f},0.2,{h:.9f},{NOISE_M}" for t, h in zip(time_s, y, strict=True)]
    path = folder / f"{name}.csv"
    path.write_text("\n".join(["time_s,object1_x_m,object1_y_m,object1_sd_m", *rows]) + "\n")
    path.with_suffix(".yaml").write_text(
        f"track: {name}.csv\nscenario: fall\nobjects:\n"
        f"  - {{name: object1, shape: sphere, size_m: [0.03]{', ' + mass if mass else ''}}}\n"
    )
    return path


def problem_of(path: Path, effects=(), engine: str = "auto"):
    clip = load_clip(path)
    return make_problem(clip, read_observation_csv(path), engine, make_effects(effects))


def simulated(problem, **given: float) -> np.ndarray:
    """Heights `[frame]` with the parameters `given`, all others absent."""
    theta = absent(problem.model.parameters)
    for name, value in {"release_instant": RELEASE_S, **given}.items():
        theta[problem.model.index(name)] = value
    return problem.simulate(theta)[0]


def test_it_falls_straight_down_as_galileo_said(tmp_path):
    problem = problem_of(write_fall(tmp_path, noise_m=0.0))
    x, y = simulated(problem)
    time_s = problem.observation.times_s
    assert y == pytest.approx(TOP_M - fallen_m(time_s), abs=EXACT_M)
    assert x == pytest.approx(np.full(FRAMES, 0.2), abs=EXACT_M)


def test_drag_leads_to_the_terminal_speed(tmp_path):
    drag = 0.02  # 5 m/s, with half a second to come near it
    problem = problem_of(write_fall(tmp_path, noise_m=0.0), ["air_drag"])
    time_s = problem.observation.times_s
    _, y = simulated(problem, air_drag=drag)
    assert y == pytest.approx(TOP_M - fallen_m(time_s, drag), abs=DRAG_M)
    speed = -np.diff(y) * FPS
    assert speed[-1] == pytest.approx(math.sqrt(MASS_KG * G / drag), rel=0.01)


def test_what_has_a_place(tmp_path):
    """No friction, and nothing that would need a surface, a table or a second object."""
    problem = problem_of(write_fall(tmp_path), effect_names())
    scene = problem.model.scene.surroundings
    assert {e.name for e in problem.model.effects if e.parameters(scene)} == HAS_A_PLACE
    assert not any(name.startswith("k") for name in problem.model.names)
    assert np.isfinite(simulated(problem)).all()


@pytest.mark.parametrize(
    ("mass", "prior"), [(f"mass_kg: {MASS_KG}", LogNormal(MASS_KG, 0.001)), ("", MASS_PRIOR)]
)
def test_a_weighed_mass_is_held(mass, prior, tmp_path):
    problem = problem_of(write_fall(tmp_path, mass=mass))
    assert problem.parameters[problem.model.index("m1")].prior == prior


def test_where_the_ball_is_across_its_fall_says_nothing(tmp_path):
    """Half a metre of wind sideways costs no chi2, a tenth of it along the fall does."""
    problem = problem_of(write_fall(tmp_path))
    seen = problem.observation.position_m
    swing = 0.5 * np.sin(np.arange(FRAMES) / 4.0)
    assert np.sum(problem.whiten(seen + np.array([[swing, 0 * swing]]), 1.0) ** 2) < FRAMES
    assert np.sum(problem.whiten(seen + np.array([[0 * swing, 0.1 * swing]]), 1.0) ** 2) > 1e3


@pytest.mark.parametrize("engine", ["c", "mjx"])
def test_mujoco_has_no_fall(engine, tmp_path):
    with pytest.raises(InputError, match=f"engine: '{engine}' has no scene without a ramp; rigid"):
        make_engine(engine, problem_of(write_fall(tmp_path)).model)


def test_trials_are_of_the_same_mass(tmp_path):
    paths = [write_fall(tmp_path), write_fall(tmp_path, "other", mass="mass_kg: 0.06")]
    with pytest.raises(InputError, match=r"other.yaml: object1.mass_kg: 0.06, but .*: 0.05; clips"):
        check_same_objects([load_clip(path) for path in paths])


def test_one_object_falls(tmp_path):
    path = write_fall(tmp_path)
    yaml = path.with_suffix(".yaml")
    yaml.write_text(yaml.read_text() + "  - {name: object2, shape: sphere}\n")
    with pytest.raises(InputError, match=r"objects: 2 objects; scenario fall \(one object is dr"):
        load_clip(yaml)


def test_fits_together_share_the_drag(tmp_path):
    """Two drops of one ball: the drag is a parameter once."""
    paths = [write_fall(tmp_path, name) for name in ("first", "second")]
    clips = [load_clip(path) for path in paths]
    seen = [read_observation_csv(path) for path in paths]
    trials = make_joint_problem(clips, seen, effects=make_effects(["air_drag"]))
    assert [name for name in trials.names if name.startswith(("m", "air"))] == ["m1", "air_drag"]


@pytest.mark.slow
def test_fit_and_diagnose_find_the_drag(tmp_path, capsys):
    """The loop on a light ball: gravity alone fails, the drag is named and measured."""
    drag = 0.003
    path, out = str(write_fall(tmp_path, drag_kg_m=drag)), tmp_path / "out"
    assert command.run(fit.main, [path, "--out", str(tmp_path / "fit")]) == 0
    alone = json.loads((tmp_path / "fit" / "result.json").read_text())
    assert alone["error"]["rms_percent_of_way"] > 1, "whatever gusts would follow the ball"
    assert "k1" not in alone["parameters"]
    assert command.run(diagnose.main, [path, "--out", str(out)]) == 0
    document = json.loads((out / "diagnosis.json").read_text())
    verdict = document["verdict"]
    assert verdict["effects"][0] == "air_drag"
    assert all("air_drag" in name.split("+") for name in verdict["effects"]), "with more or without"
    first = document["candidates"][0]["parameters"]["air_drag"]
    assert first["q025"] < drag < first["q975"]
    first, last = (document["history"][i] for i in (0, -1))
    assert last["chi2_per_dof"] < 1.5 and last["rmse"] < 0.5 * first["rmse"]
    assert "rolling" in document["left_out"]
