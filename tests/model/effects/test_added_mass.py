"""The fluid that a body carries along, against closed forms: falls, flights, swings, liquids."""

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy import stats

import galileo_jax as gx
from galileo_jax.assembly.build_problem import make_problem
from galileo_jax.clip.load import load_clip
from galileo_jax.clip.scenarios import SCENARIOS
from galileo_jax.clip.track_csv import read_observation_csv
from galileo_jax.model.effects import make_effects
from galileo_jax.model.effects.air import AIR_KG_M3
from galileo_jax.model.effects.library.added_mass import PRIOR
from galileo_jax.model.parameters import LongTailed, absent
from galileo_jax.rollout.motion import dynamics
from tests.clip.test_pendulum import angles, closed_form

G, M, SHARE = 9.81, 0.1, 0.08
SLOWER = G * (1 - 2 * SHARE) / (1 + SHARE)
TIMES = np.arange(40) / 60
EXACT_M = 1e-9


def problem_of(folder: Path, scenario: str, size: str = "[0.02]", mass: str = "null"):
    """A clip of the scenario; where its track goes is not looked at."""
    path = folder / "clip.csv"
    up = -0.7 if SCENARIOS[scenario].up_shows == "sag" else 0.7
    place = [f"{t},{0.7 * math.sin(t)},{up * math.cos(t)},0.001" for t in TIMES - 0.3]
    path.write_text("\n".join(["time_s,object1_x_m,object1_y_m,object1_sd_m", *place]) + "\n")
    path.with_suffix(".yaml").write_text(
        f"track: clip.csv\nscenario: {scenario}\n"
        f"objects: [{{name: object1, shape: sphere, size_m: {size}, mass_kg: {mass}}}]\n"
    )
    effects = make_effects(("added_mass", "viscous_drag"))
    return make_problem(load_clip(path), read_observation_csv(path), "auto", effects)


def rolled(problem, **given: float) -> tuple[np.ndarray, np.ndarray]:
    """Times and centres `[axis, record]` since the start."""
    theta = absent(problem.model.parameters)
    for name, value in {"m1": M, **given}.items():
        theta[problem.model.index(name)] = value
    position, _ = problem.engine.simulate(theta[None])
    place = position[0, 0]
    return np.arange(place.shape[-1]) * problem.model.record_dt_s, place - place[:, :1]


def test_a_fall_is_slower(tmp_path):
    t, (_, y) = rolled(problem_of(tmp_path, "fall"), added_mass=SHARE)
    assert y == pytest.approx(-0.5 * SLOWER * t**2, abs=EXACT_M)


def test_a_drag_brakes_what_is_carried_along_too(tmp_path):
    drag, problem = 0.2, problem_of(tmp_path, "fall")
    t, (_, y) = rolled(problem, added_mass=SHARE, viscous_drag=drag)
    rate = drag / (M * (1 + SHARE))
    fallen = SLOWER / rate * (t - (1 - np.exp(-rate * t)) / rate)
    assert y == pytest.approx(-fallen, abs=1e-7)


def test_a_flight_is_flatter(tmp_path):
    start = {"start_velocity_x": 3.0, "start_velocity_y": 4.0}
    t, (x, y) = rolled(problem_of(tmp_path, "flight"), added_mass=SHARE, **start)
    assert x == pytest.approx(3.0 * t, abs=EXACT_M)
    assert y == pytest.approx(4.0 * t - 0.5 * SLOWER * t**2, abs=EXACT_M)


def test_a_pendulum_swings_as_where_gravity_is_less(tmp_path):
    given = {"thread_length": 0.7, "start_angle": 0.9, "start_speed": 0.0, "added_mass": SHARE}
    t, place = rolled(problem_of(tmp_path, "pendulum"), **given)
    expected = closed_form(t * math.sqrt(SLOWER / G), 0.9)
    assert angles(place, 0.9) == pytest.approx(expected, abs=1e-8)


def test_in_a_liquid_it_is_inertia_alone(tmp_path):
    given = {"density_ratio": 0.5, "liquid_drag": 0.3, "added_mass": SHARE}
    t, (_, y) = rolled(problem_of(tmp_path, "liquid"), **given)
    terminal = math.sqrt(M * G * 0.5 / 0.3)
    rate = G * 0.5 / (1.25 + SHARE) / terminal
    assert y == pytest.approx(-terminal / rate * np.log(np.cosh(rate * t)), abs=1e-7)


def test_it_has_no_place_on_a_surface_or_a_spring(tmp_path):
    (effect,) = make_effects(("added_mass",))
    scene = problem_of(tmp_path, "fall").model.scene.surroundings
    assert effect.parameters(scene)
    for other in (replace(scene, has_surface=True), replace(scene, laws=("spring",))):
        assert effect.parameters(other) == ()
        assert effect.force({}, other) is None and effect.inertia({}, other) is None


def test_of_a_ball_of_known_size_and_mass_it_is_known(tmp_path):
    (effect,) = make_effects(("added_mass",))
    size, mass = 0.02, 0.0027
    known = problem_of(tmp_path, "fall", f"[{size}]", str(mass)).model.scene.surroundings
    (parameter,) = effect.parameters(known)
    displaced = AIR_KG_M3 * 4 / 3 * math.pi * size**3
    assert isinstance(parameter.prior, LongTailed)
    assert parameter.prior.median == pytest.approx(displaced / 2 / mass)
    (parameter,) = effect.parameters(problem_of(tmp_path, "fall").model.scene.surroundings)
    assert parameter.prior == PRIOR


def test_a_fluid_that_nobody_declared_is_as_likely_as_if_nothing_had_been(tmp_path):
    (effect,) = make_effects(("added_mass",))
    known = problem_of(tmp_path, "fall", "[0.02]", "0.0027").model.scene.surroundings
    unknown = problem_of(tmp_path, "fall").model.scene.surroundings

    def density(scene, value: float) -> float:
        """Of the logarithm, as a verdict counts it: the prior's, times the odds."""
        (parameter,) = effect.parameters(scene)
        ends = parameter.prior.inverse(value * np.exp([-1e-4, 1e-4]))
        slope = np.diff(ends)[0] / 2e-4
        return stats.norm.pdf(ends.mean()) * slope * effect.odds({"added_mass": value}, scene)

    air = known.expected["added_mass"][0]
    assert effect.odds({"added_mass": air}, known) == pytest.approx(1.0, abs=0.1)
    assert density(known, 0.15) == pytest.approx(density(unknown, 0.15), rel=0.05)
    assert density(known, air) > 5 * density(unknown, air)
    assert effect.odds({"added_mass": 0.15}, unknown) == 1.0


@pytest.mark.slow
@pytest.mark.parametrize("scenario, share", [("fall", 0.15), ("flight", 0.15), ("pendulum", 0.1)])
def test_more_than_air_is_not_named_something_else(tmp_path, scenario, share):
    path, hidden = tmp_path / "clip.csv", {"added_mass": {"added_mass": share}}
    gx.simulate(path, scenario=scenario, seed=8, effects=hidden, track_only=True)
    assert gx.load(path).objects[0].mass_kg is not None
    verdict = gx.diagnose(path).document["verdict"]
    assert "added_mass" in verdict["effects"], verdict


def test_pushes_in_a_flight_are_put_together_for_many_parameters_at_once(tmp_path):
    model = problem_of(tmp_path, "flight").model
    theta = {name: np.tile(value, 3) for name, value in zip(
        model.names, absent(model.parameters), strict=True)}  # fmt: skip
    law = dynamics(model.effects, model.scene.surroundings, theta, np)
    for push in law.pushes:
        assert np.shape(push(np.array([1.0, 2.0]), np.array(0.1)))[-1] == 2
