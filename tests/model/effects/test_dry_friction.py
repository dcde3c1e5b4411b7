"""A load on a spring that rubs on its track: the closed form, SciPy's integrator, and a fit."""

import math

import numpy as np
import pytest

from galileo_jax.api.fit import fit
from galileo_jax.api.simulate import simulate
from galileo_jax.assembly.build_problem import make_problem
from galileo_jax.clip.load import load_clip
from galileo_jax.clip.track_csv import read_observation_csv
from galileo_jax.model.effects import make_effects
from galileo_jax.model.parameters import absent
from galileo_jax.rollout.acting_laws import ActingLaws

K, G, REST = 0.02, 9.81, 0.1
SWING = {"period": 1.0, "damping": 1e-9, "rest": REST, "start_speed": 0.0}
HIDDEN = {"dry_friction": {"dry_friction": K}}


def clip(folder, values=SWING, seconds=4.0, noise_m=1e-6):
    return simulate(
        folder / "clip.csv",
        scenario="spring",
        seed=3,
        fps=60.0,
        seconds=seconds,
        track_only=True,
        track_noise=noise_m,
        values=values,
        effects=HIDDEN,
    )


def test_swings_shrink_by_the_same_length_until_friction_holds(tmp_path):
    """About k g / w^2 to either side of the middle, half a period each."""
    clip(tmp_path)
    own = read_observation_csv(tmp_path / "clip.csv")
    down_m = own.position_m[0, 1, 0] - own.position_m[0, 1]
    shift, expected, turn = K * G / (2 * math.pi) ** 2, [], 0.0
    for half in range(8):
        middle = REST + shift * math.copysign(1.0, turn - REST)
        if abs(turn - REST) > shift:
            turn = 2 * middle - turn
        expected.append(turn)
        assert down_m[30 * (half + 1)] == pytest.approx(turn, abs=1e-5)
    assert np.ptp(expected[-5:]) > 0.01
    assert np.ptp(down_m) > 0.19


@pytest.mark.parametrize("start_speed", [0.0, 0.4])
def test_the_engine_is_scipys_motion(start_speed, tmp_path):
    """Over turns and to where it rests."""
    (truth,) = clip(tmp_path, SWING | {"damping": 0.2, "start_speed": start_speed}, 5.0).truths
    loaded = load_clip(tmp_path / "clip.csv")
    observation = read_observation_csv(tmp_path / "clip.csv")
    problem = make_problem(loaded, observation, "auto", make_effects(["dry_friction"]))
    theta = absent(problem.model.parameters)
    for name, value in truth["parameters"].items():
        theta[problem.model.index(name)] = value
    seen = problem.simulate(theta)
    assert seen == pytest.approx(observation.position_m, abs=1e-5)
    assert np.ptp(observation.position_m[0, 1, -20:]) < 1e-5  # at rest


def test_what_does_not_rub_has_a_program_without_turns(tmp_path):
    clip(tmp_path)
    observation = read_observation_csv(tmp_path / "clip.csv")
    loaded = load_clip(tmp_path / "clip.csv")
    model = make_problem(loaded, observation, "auto", make_effects(["dry_friction"])).model
    theta = np.tile(absent(model.parameters), (2, 1))
    theta[1, model.index("dry_friction")] = K
    shares = ActingLaws(model).shares(theta)
    assert [rows.tolist() for _, rows in shares] == [[0], [1]]
    assert ["dry_friction" in share.names for share, _ in shares] == [False, True]


def test_a_fit_tells_it_from_damping(tmp_path):
    made = clip(tmp_path, SWING | {"damping": 0.1}, 3.0, 5e-4)
    found = fit(made.clips[0], effects=["dry_friction"]).parameters
    for name, true in (("dry_friction", K), ("period", 1.0), ("damping", 0.1)):
        assert abs(found[name]["mean"] - true) < 4 * found[name]["sd"], name
    assert found["dry_friction"]["sd"] < K / 10


def test_a_long_clip_moves_to_its_end(tmp_path):
    """However long a clip of its scenario is if nobody says it."""
    simulate(tmp_path / "clip.csv", scenario="spring", seed=1, seconds=5.0, track_only=True)
    own = read_observation_csv(tmp_path / "clip.csv")
    assert np.ptp(own.position_m[0, 1, -30:]) > 0.01
