import json
import math
from pathlib import Path

import numpy as np
import pytest

from galileo_jax.api.simulate import simulate
from galileo_jax.clip.load import load_clip
from galileo_jax.clip.track_csv import read_observation_csv
from galileo_jax.model.effects.registry import make_effects
from galileo_jax.model.parameters import absent
from galileo_jax.runtime.errors import InputError
from galileo_jax.simulation.hidden import Hidden, hide
from galileo_jax.simulation.motion import roll_out
from galileo_jax.simulation.ramp_clip import draw_series
from galileo_jax.simulation.truth import Declared, draw_truth
from tests.model.effects.motion import LIBRARY

# The two integrators differ by where within 0.1 ms a hit or a stop is put.
SOLVERS_AGREE_M = 1e-4
# What a wrong declaration does beside its effect: second order in the start offset's place.
MENDED_M = 5e-4


def hidden(name: str, strength: float = 0.5, **given: float) -> Hidden:
    return Hidden(make_effects([name])[0], given, strength)


def trials(*effects: Hidden, count: int = 1, seed: int = 2, angle_deg: float = 20.0, faults=False):
    things, secrets = np.random.default_rng(seed).spawn(2)
    return draw_series(
        angle_deg,
        {},
        effects,
        count,
        solver="fine",
        things=things,
        secrets=secrets,
        frame_s=1 / 30 if faults else None,
    )


@pytest.mark.slow
@pytest.mark.parametrize("strength", [0.0, 1.0])
@pytest.mark.parametrize("name", LIBRARY)
def test_solvers_agree_about_the_library(name, strength):
    ((truth, fine),) = trials(hidden(name, strength), seed=1)
    exact = roll_out(truth, "rigid")
    assert fine.position_m == pytest.approx(exact.position_m, abs=SOLVERS_AGREE_M)


@pytest.mark.parametrize("names", [("restitution",), ("static_friction", "spring_tether")])
def test_solvers_agree(names):
    ((truth, fine),) = trials(*map(hidden, names), faults=True)
    exact = roll_out(truth, "rigid")
    assert exact.events_s(truth)["hit"] is not None
    assert fine.position_m == pytest.approx(exact.position_m, abs=SOLVERS_AGREE_M)


def test_solvers_agree_when_object_1_pushes():
    truth = draw_truth(np.random.default_rng(0), 20.0, {"k1": 0.05, "k2": 0.3})
    fine, exact = roll_out(truth, "fine"), roll_out(truth, "rigid")
    assert fine.position_m == pytest.approx(exact.position_m, abs=SOLVERS_AGREE_M)
    x = fine.position_m[:, 0, -1]
    length = sum(truth.surroundings.half_length_m)
    assert x[1] - x[0] == pytest.approx(length, abs=1e-6)


def test_fine_solver_keeps_what_must_not_move():
    truth = draw_truth(np.random.default_rng(0), 10.0, {"k1": 0.5})
    motion = roll_out(truth, "fine", seconds=0.2)
    assert (motion.position_m == motion.position_m[..., :1]).all()
    assert not motion.velocity_m_s.any()


def test_strength_orders_what_is_drawn():
    truth = draw_truth(np.random.default_rng(1), 20.0, {})
    sizes = []
    for strength in (0.0, 0.5, 1.0):
        told = hide(truth, hidden("air_drag", strength), np.random.default_rng(0))
        sizes.append(told.effect_values["air_drag"] / truth.mass_kg[0])
    assert sizes == pytest.approx([0.4, math.sqrt(0.8), 2.0])


def test_given_values_are_kept_and_others_drawn():
    truth = draw_truth(np.random.default_rng(1), 20.0, {})
    told = hide(
        truth, hidden("friction_patch", friction_patch_length=0.1), np.random.default_rng(3)
    )
    values = told.effect_values
    assert values["friction_patch_length"] == 0.1
    start = truth.surroundings.start_path_m
    assert start[0] < values["friction_patch_start"] < start[1] - 0.1
    with pytest.raises(InputError, match="has no parameter 'drag'; known: air_drag"):
        hide(truth, hidden("air_drag", drag=0.1), np.random.default_rng(0))


def test_a_series_shares_the_objects_and_the_effect():
    told = [truth for truth, _ in trials(hidden("air_drag"), hidden("initial_push"), count=3)]
    for key in ("mass_kg", "friction", "objects", "ramp_angle_deg"):
        assert len({getattr(truth, key) for truth in told}) == 1
    for key in ("release_m", "stand_x_m"):
        assert len({getattr(truth, key) for truth in told}) == 3
    assert len({truth.effect_values["air_drag"] for truth in told}) == 1
    assert len({truth.effect_values["initial_push"] for truth in told}) == 3


def test_what_is_declared():
    truth = draw_truth(np.random.default_rng(0), 20.0, {})
    wrong = {"frame_rate": 0.05, "scale_error": -0.04, "release_delay": 0.2, "ramp_angle": 0.02}
    for name, value in wrong.items():
        truth = hide(truth, hidden(name, **{name: value}), np.random.default_rng(0))
    declared = Declared.of(truth.effect_values, 30.0, truth.ramp_angle_deg)
    assert (declared.fps, declared.ramp_angle_deg) == (30.0, 20.0)
    assert truth.ramp_angle_deg == pytest.approx(20 + math.degrees(0.02))
    assert declared.true_fps == pytest.approx(30 / 1.05)
    assert declared.scale == pytest.approx(0.96)
    assert declared.taken_s(2) == pytest.approx([-0.2, 1.05 / 30 - 0.2])


@pytest.mark.parametrize("name", ["frame_rate", "ramp_angle", "release_delay", "scale_error"])
def test_the_library_mends_what_simulate_hides(name, tmp_path, x64):
    """The effect at its true value explains the clip that a user gets; without it nothing does."""
    from galileo_jax.assembly.build_scene import build_scene
    from galileo_jax.inference.problem import Problem
    from galileo_jax.model.model import Model
    from galileo_jax.rollout.engines import make_engine

    path = tmp_path / "clip.csv"
    made = simulate(
        path,
        track_only=True,
        solver="fine",
        seed=4,
        track_noise=1e-5,
        effects=[name],
        strength=0.7,
    )
    (truth,) = made.truths
    assert truth["effect"] == name
    clip, observed = load_clip(path), read_observation_csv(path)
    errors = {}
    for names in ((), (name,)):
        scene = build_scene(clip, observed)
        model = Model(scene, float(observed.times_s[-1]) + 1.0, effects=make_effects(names))
        theta = absent(model.parameters)
        known = {key: truth[key] for key in ("m1", "k1", "m2", "k2")}
        for key, value in (known | truth["effect_parameters"] if names else known).items():
            theta[model.index(key)] = value
        problem = Problem(observed, model, make_engine("rigid", model))
        predicted = problem.simulate(theta)
        errors[names] = np.abs(predicted - observed.position_m).max()
    assert errors[(name,)] < MENDED_M
    assert errors[()] > 10 * MENDED_M


def test_truth_file_says_what_the_yaml_does_not(tmp_path):
    path = tmp_path / "clip.csv"
    effects = {"scale_error": {"scale_error": 0.05}, "air_drag": {}}
    simulate(path, track_only=True, effects=effects, faults=True, series=2)
    names = sorted(item.name for item in tmp_path.iterdir())
    ends = (".csv", ".truth.json", ".yaml")
    assert names == sorted(f"clip_{i}{end}" for i in (1, 2) for end in ends)
    truths = [json.loads((tmp_path / f"clip_{i}.truth.json").read_text()) for i in (1, 2)]
    assert {truth["effect"] for truth in truths} == {"air_drag+scale_error"}
    assert truths[0]["effect_parameters"] == truths[1]["effect_parameters"]
    assert truths[0]["effect_parameters"]["scale_error"] == 0.05
    assert {truth["series"] for truth in truths} == {"clip"}
    assert truths[0]["nuisances"].keys() == {
        "foot_transition",
        "impact_restitution",
        "release_instant",
    }
    yaml = Path(tmp_path / "clip_1.yaml").read_text()
    assert "scale_error" not in yaml
    assert "air_drag" not in yaml
