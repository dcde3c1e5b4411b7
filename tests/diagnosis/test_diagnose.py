"""The whole loop on tracks that the package simulates: a strong effect is named, none is none."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import yaml

from galileo_jax.assembly.build_problem import make_joint_problem
from galileo_jax.clip.load import load_clip
from galileo_jax.clip.track_csv import write_observation_csv
from galileo_jax.diagnosis import diagnose as diagnose_module
from galileo_jax.diagnosis.diagnose import diagnose
from galileo_jax.diagnosis.diagnosis import Diagnosis, Round
from galileo_jax.inference.joint_problem import JointProblem
from galileo_jax.model.effects.registry import make_effects
from galileo_jax.observation.observation import Observation
from galileo_jax.report import diagnosis_text
from galileo_jax.simulation.hidden import Hidden
from galileo_jax.simulation.ramp_clip import draw_series

# Of all the library only these: what is near air drag, and what changes the start or the hit.
CANDIDATES = ("air_drag", "release_delay", "restitution", "viscous_drag")
AIR_DRAG_KG_M = 0.6
GIVEN = {"m1": 0.5, "k1": 0.1, "m2": 0.3, "k2": 0.2}
ANGLE_DEG, FPS, NOISE_M = 20.0, 30.0, 3e-4


def simulated(
    folder: Path, *hidden: Hidden, stated_m: float = NOISE_M, noise_m: float = NOISE_M
) -> JointProblem:
    """Trials of one simulated track of two boxes on a ramp, about 45 frames.

    Args:
      folder: where its files are written.
      *hidden: what is hidden in it.
      stated_m: the noise that the track states, whatever is there.
      noise_m: that is there.
    """
    things, secrets, camera = np.random.default_rng(1).spawn(3)
    ((truth, motion),) = draw_series(
        ANGLE_DEG, GIVEN, hidden, 1, solver="rigid", things=things, secrets=secrets
    )
    times = np.arange(0.0, motion.rest_s + 0.1, 1 / FPS)
    centres = motion.at(times).position_m
    count, _, frames = centres.shape
    observation = Observation(
        names=tuple(each.name for each in truth.objects),
        times_s=times,
        position_m=centres + noise_m * camera.standard_normal(centres.shape),
        covariance_m2=np.tile(stated_m**2 * np.eye(2)[None, ..., None], (count, 1, 1, frames)),
        mask=np.ones((count, frames), bool),
    )
    write_observation_csv(folder / "clip.csv", observation)
    objects = [
        {"name": each.name, "shape": each.shape, "size_m": list(each.size_m or ())}
        for each in truth.objects
    ]
    declared = {"track": "clip.csv", "scenario": "ramp", "fps": FPS, "ramp_angle_deg": ANGLE_DEG}
    (folder / "clip.yaml").write_text(yaml.safe_dump(declared | {"objects": objects}))
    clip = load_clip(folder / "clip.yaml")
    return make_joint_problem([clip], [observation], effects=make_effects(CANDIDATES))


def diagnosed(trials: JointProblem) -> tuple[Diagnosis, list[Round]]:
    """The diagnosis, and the rounds as they were told of."""
    rounds: list[Round] = []
    return diagnose(trials, on_round=rounds.append), rounds


def test_a_strong_air_drag_is_named_and_added(tmp_path):
    (air_drag,) = make_effects(["air_drag"])
    # With more noise some of it may be viscous drag: of so few effects pairs are not rare.
    fine = {"stated_m": NOISE_M / 3, "noise_m": NOISE_M / 3}
    trials = simulated(tmp_path, Hidden(air_drag, {"air_drag": AIR_DRAG_KG_M}), **fine)
    found, told = diagnosed(trials)
    assert (found.verdict.status, found.verdict.effects) == ("named", ("air_drag",))
    before, after = found.rounds
    assert list(told) == [before, after]
    assert before.hypothesis.effects == () and after.hypothesis.effects == ("air_drag",)
    assert before.comparison.p_value < 1e-6 and after.comparison.is_adequate
    assert after.comparison.error["rmse"] < 0.5 * before.comparison.error["rmse"]
    # The drag itself is known as far as the mass is, k1 by itself.
    theta = trials.theta(after.hypothesis.fit.z, after.hypothesis.fit.free)
    value = dict(zip(trials.names, theta, strict=True))
    per_mass = value["air_drag"] / value["m1"]
    assert per_mass == pytest.approx(AIR_DRAG_KG_M / GIVEN["m1"], rel=0.05)
    assert value["k1"] == pytest.approx(GIVEN["k1"], abs=0.01)
    best = found.candidates[0]
    assert best.effects == ("air_drag",) and best.probability > 0.95
    assert best.p_value == after.comparison.p_value
    assert best.confounded_with == ()


def test_without_an_effect_nothing_is_missing(tmp_path):
    found, told = diagnosed(simulated(tmp_path))
    assert (found.verdict.status, found.verdict.effects) == ("none", ())
    assert list(found.rounds) == told and len(told) == 1
    assert found.base.is_adequate
    assert sum(each.probability for each in found.candidates) < 0.2
    assert found.probability_none > 0.8
    rules = [why.rule for why in found.verdict.reasons]
    assert rules == ["adequate_without_effects", "nothing_convinces"]
    assert {each.name for each in found.candidates} == set(CANDIDATES)


@pytest.mark.slow
def test_two_effects_are_named_together(tmp_path):
    """Neither explains the data alone, so that pairs are tried."""
    air_drag, restitution = make_effects(["air_drag", "restitution"])
    trials = simulated(
        tmp_path,
        Hidden(air_drag, {"air_drag": AIR_DRAG_KG_M}),
        Hidden(restitution, {"restitution": 0.5}),
    )
    found, told = diagnosed(trials)
    assert found.verdict.status == "named"
    assert set(found.verdict.effects) == {"air_drag", "restitution"}
    assert set(told[-1].hypothesis.effects) == {"air_drag", "restitution"}
    rules = [why.rule for why in found.verdict.reasons]
    assert rules[:4] == ["contradicted_without_effects", "pairs_tried", "explains", "decisive"]
    total = sum(each.probability for each in found.candidates) + found.probability_none
    assert total == pytest.approx(1.0)


def test_noise_of_twice_the_stated_size_is_told_as_that(tmp_path):
    found, _ = diagnosed(simulated(tmp_path, stated_m=NOISE_M / 2))
    assert (found.verdict.status, found.verdict.effects) == ("none", ())
    first = found.verdict.reasons[0]
    assert first.rule == "noise_misstated"
    assert first.numbers["noise_scale_largest"] == pytest.approx(2.0, abs=0.25)


def test_where_nothing_moves_that_is_said_and_nothing_is_searched(tmp_path, monkeypatch):
    """However little the model without effects describes what the camera did."""
    trials = simulated(tmp_path, stated_m=1e-6, noise_m=1e-6)
    (problem,) = trials.problems
    seen = problem.observation
    creeps = seen.position_m[..., :1] + 2e-6 * np.arange(len(seen.times_s))
    still = replace(problem, observation=replace(seen, position_m=creeps))
    monkeypatch.setattr(diagnose_module, "search", None)
    found = diagnose(JointProblem((still,)))
    assert found.verdict.status == "none" and found.candidates == ()
    assert [why.rule for why in found.verdict.reasons] == ["nothing_moves"]
    assert diagnosis_text.verdict(found) == "Nothing moves: no effect can be told."
