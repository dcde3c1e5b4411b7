"""`galileo diagnose`: diagnosis.json by contract, a hidden effect is found, wrong calls."""

import json
from dataclasses import replace

import numpy as np
import pytest

from galileo_jax.api import diagnose as api
from galileo_jax.api.simulate import simulate
from galileo_jax.assembly.build_problem import make_problem
from galileo_jax.commands import command, diagnose
from galileo_jax.diagnosis.document import diagnosis_document
from galileo_jax.diagnosis.restricted_fit import fit_among
from galileo_jax.inference.fit_posterior import laplace_posterior
from galileo_jax.inference.joint_problem import JointProblem
from galileo_jax.model.effects.registry import make_effects
from galileo_jax.results.run import load_run
from galileo_jax.runtime.atomic_write import write_json
from galileo_jax.runtime.errors import InputError
from tests.clip.broken_clips import build_good_track
from tests.found import LAW, diagnosis_of, fit_of, make_trials
from tests.oracle_run import HIT, make_run
from tests.precision import in_64_bit

ENTRY = {"mean", "sd", "q025", "q975", "unit", "identified"}
PLACE = {"object", "axis", "phase", "rmse", "noise", "z"}
CANDIDATE = {"effect", "parameters", "rmse", "chi2_per_dof", "score", "probability"}
ODDS = {"log_evidence", "log_prior", "p_value"}
STATUSES = ("none", "named", "ambiguous", "unknown")


@pytest.fixture(autouse=True)
def precision():
    with in_64_bit():
        yield


@pytest.fixture(scope="module")
def trials(tmp_path_factory):
    with in_64_bit():
        return make_trials(tmp_path_factory.mktemp("clip"))


def check_contract(document):
    """The keys that docs/reference/result_files.md lists for diagnosis.json."""
    assert isinstance(document["adequate"], bool)
    assert 0 <= document["p_value"] <= 1
    assert all(set(place) >= PLACE for place in document["where"])
    for candidate in document["candidates"]:
        assert set(candidate) >= CANDIDATE | ODDS | {"confounded_with"}
        assert candidate["score"] == candidate["log_evidence"] + candidate["log_prior"]
        assert all(set(entry) >= ENTRY for entry in candidate["parameters"].values())
        assert {"k1"} <= set(candidate["parameters"])
    scores = [candidate["score"] for candidate in document["candidates"]]
    assert scores == sorted(scores, reverse=True), "best first"
    shares = [candidate["probability"] for candidate in document["candidates"]]
    assert sum(shares) + document["probability_none"] == pytest.approx(1.0)
    assert all({"rule", "sentence"} <= set(why) for why in document["reasons"])
    status, effects = document["verdict"]["status"], document["verdict"]["effects"]
    assert status in STATUSES
    assert bool(effects) == (status in ("named", "ambiguous"))
    assert document["history"][0]["effects"] == []
    for row in document["history"]:
        assert set(row) >= {"effects", "rmse", "chi2_per_dof", "p_value", "k1"}


@pytest.mark.parametrize("status", STATUSES)
def test_the_document_keeps_the_contract(status, trials, tmp_path):
    document = diagnosis_document(trials, diagnosis_of(trials, status), 0)
    write_json(tmp_path / "diagnosis.json", document)
    document = json.loads((tmp_path / "diagnosis.json").read_text())
    check_contract(document)
    assert document["verdict"]["status"] == status
    first = document["candidates"][0]
    assert set(first["parameters"]) == {"m1", "k1", "m2", "k2", "air_drag"}, "only its own"
    assert first["parameters"]["air_drag"]["unit"] == "kg/m"
    assert first["confounded_with"] == (["viscous_drag"] if status == "ambiguous" else [])
    assert ("missing_force" in document) == (status == "unknown")
    if status == "unknown":
        missing = document["missing_force"]["objects"]["object1"]
        assert missing["formula"] == "no formula explains it"
        best = document["missing_force"]["best_formula"]
        assert (best["law"], best["explains"], best["p_value"]) == (LAW.text, False, 3e-4)
        assert missing["share_explained"] == 1.0, "as a share of chi2, all the same"
        assert missing["acceleration_m_s2"][0] is None, "not known before it moves"
        assert len(missing["acceleration_m_s2"]) == len(document["missing_force"]["time_s"])


def test_a_hypothesis_by_itself_moves_as_in_the_library(trials, tmp_path):
    """The smaller model gives the same trajectory from the same fit, bit for bit."""
    run = make_run(tmp_path, HIT, 1.6)
    problem = make_problem(run.clip, run.problem.observation, "rigid", make_effects(["air_drag"]))
    part, fit = JointProblem((problem,)), fit_of(trials, ("air_drag",))
    alone = fit_among(fit, trials, part)
    assert alone.free.all()
    assert alone.jacobian.shape == (part.num_values, len(part.model_parameters))
    whole = trials.problems[0].simulate(trials.of_clip(trials.theta(fit.z, fit.free), 0))
    np.testing.assert_array_equal(problem.simulate(part.of_clip(part.theta(alone.z), 0)), whole)
    two = fit_among(replace(fit, beside=(fit,)), trials, part)
    np.testing.assert_array_equal(two.beside[0].z, alone.z)
    assert laplace_posterior(part, two, seed=1).draws.shape[-1] == len(part.parameters)
    again = fit_among(alone, part, trials)
    for name in ("z", "free", "covariance", "jacobian"):
        np.testing.assert_array_equal(getattr(again, name), getattr(fit, name), name)
    with pytest.raises(ValueError, match="has not"):
        fit_among(fit_of(trials, ("viscous_drag",)), trials, part)


@pytest.mark.slow
def test_finds_what_was_hidden(tmp_path, capsys):
    """A csv track with strong air drag: told, added, the error falls, and the run can be read."""
    simulate(tmp_path / "a.csv", track_only=True, effects=["air_drag"], strength=1.0, seed=3)
    out = tmp_path / "out"
    capsys.readouterr()
    assert command.run(diagnose.main, [str(tmp_path / "a.csv"), "--out", str(out)]) == 0
    told = capsys.readouterr().out
    document = json.loads((out / "diagnosis.json").read_text())
    check_contract(document)
    assert document["sentence"].endswith(".")
    assert not document["adequate"]
    assert document["verdict"]["status"] == "named", document["verdict"]
    assert document["verdict"]["effects"] == ["air_drag"]
    before, after = document["history"][0], document["history"][-1]
    assert after["effects"] == ["air_drag"]
    assert after["chi2_per_dof"] < 1.5 < before["chi2_per_dof"]
    assert after["rmse"] < 1.1 * after["noise"]
    assert "truth: air_drag" in told
    [added] = [one for one in document["candidates"] if one["effect"] == "air_drag"]
    assert added["parameters"]["k1"] == after["k1"], "one strength wherever it is said"
    assert [why["rule"] for why in document["reasons"]][:4] == [
        "contradicted_without_effects",
        "no_pair_contests",
        "explains",
        "decisive",
    ]
    said = [why["sentence"] for why in document["reasons"] if why["rule"] != "told_apart"]
    assert all(f"why: {sentence}" in told for sentence in said)
    assert "next: galileo fit" in told and "--effects air_drag" in told
    rows = [line for line in told.splitlines() if line.startswith(("no effects", "air_drag"))]
    assert len(rows) >= 2, "one row per round"
    run = load_run(out / "model")
    assert run.result["effects"] == ["air_drag"]
    assert "air_drag" in run.posterior.names
    assert (out / "report.html").is_file()


def test_what_has_no_place_is_no_candidate(tmp_path):
    """One object on a slope: nothing to hit, no table."""
    clip = build_good_track(tmp_path)
    words = [str(clip), "--add", "restitution", "--out", str(tmp_path / "out")]
    with pytest.raises(InputError, match="restitution has no place in"):
        diagnose.main(words)


def test_ctrl_c_leaves_nothing_half_done(tmp_path, capfd, monkeypatch):
    def stopped(*_, **__):
        raise KeyboardInterrupt

    monkeypatch.setattr(api, "run_loop", stopped)
    clip, out = build_good_track(tmp_path), tmp_path / "out"
    assert command.run(diagnose.main, [str(clip), "--out", str(out)]) == 130
    assert "stopped" in capfd.readouterr().err
    assert not out.exists()


def test_a_damaged_truth_is_said(tmp_path, capfd):
    clip = build_good_track(tmp_path)
    (tmp_path / "clip.truth.json").write_text('{"m1": 1}')
    assert command.run(diagnose.main, [str(clip)]) == 2
    assert "clip.truth.json: not a truth with an effect" in capfd.readouterr().err
