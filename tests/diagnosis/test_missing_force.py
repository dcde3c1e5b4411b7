"""Truths with a hidden effect, models without: the missing acceleration."""

import json
import re
import subprocess
import sys
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from benchmarks.hidden_cases import EXOTIC_FILE
from galileo_jax.assembly.build_problem import make_joint_problem
from galileo_jax.clip.load import load_clip
from galileo_jax.clip.track_csv import read_observation_csv
from galileo_jax.diagnosis.missing_force import infer_missing_force, views_of
from galileo_jax.inference.fits.gradient import GradientFitter
from galileo_jax.inference.joint_problem import JointProblem
from galileo_jax.model.effects.effect import State, Surroundings
from galileo_jax.model.effects.free_acceleration import FreeAcceleration, splines
from galileo_jax.model.effects.registry import make_effects
from galileo_jax.search.fit import best_fit
from galileo_jax.search.hypothesis import Hypothesis
from tests.oracle_trials import make_trials
from tests.ramp_model import HIT

NOISE_M = 3.3e-4  # 0.3 px at 900 px/m
LEAST_COVERED = 0.85  # of the times, by a band for 95 %: neighbours err together


@pytest.fixture(scope="module")
def infer(tmp_path_factory):
    """From a seed and what is hidden to the missing force and the truth.

    An effect of the library that is hidden is what explains the data; it is missing.
    """

    @cache
    def made(seed: int, *hidden: str):
        folder = Path(tmp_path_factory.mktemp("clip"))
        clip = load_clip(simulated(folder, seed, *hidden))
        assert clip.track is not None
        effects = make_effects(hidden[1:2])
        trials = make_joint_problem([clip], [read_observation_csv(clip.track)], effects=effects)
        fitter, names = GradientFitter(trials), tuple(effect.name for effect in effects)
        base = Hypothesis((), best_fit(fitter, seed=0, effects=()))
        around = Hypothesis(names, best_fit(fitter, seed=0, effects=names)) if names else base
        missing = infer_missing_force(trials, around, seed=0, views=views_of(trials, base))
        return missing, json.loads((folder / "c.truth.json").read_text())

    return made


def simulated(folder: Path, seed: int, *hidden: str) -> Path:
    call = ["--track-only", "--solver", "fine", "--angle", "20", "--fps", "60"]
    call += ["--track-noise", repr(NOISE_M), "--seed", str(seed), "--out", f"{folder}/c.csv"]
    # In a process of its own: an exotic effect must not stay in this one's library.
    command = [sys.executable, "-m", "galileo_jax", "simulate", *call, *hidden]
    subprocess.run(command, check=True, capture_output=True)
    return folder / "c.yaml"


def covered(missing, index, true):
    """The share of the times at which the 95 % band has the true acceleration, m/s^2."""
    seen = np.isfinite(missing.acceleration_m_s2[index])
    off = missing.acceleration_m_s2[index] - true
    return np.mean(np.abs(off[seen]) < 1.96 * missing.sd_m_s2[index, seen])


def test_air_drag_is_what_is_missing(infer):
    missing, truth = infer(1, "--effect", "air_drag", "--strength", "0.7")
    constant = truth["effect_parameters"]["air_drag"]
    for i in range(2):
        speed = missing.speed_m_s[i]
        true = -constant / truth[f"m{i + 1}"] * speed * np.abs(speed)
        assert covered(missing, i, true) > LEAST_COVERED
    seen, speed = np.isfinite(missing.acceleration_m_s2[0]), missing.speed_m_s[0]
    largest = constant / truth["m1"] * np.nanmax(speed[seen]) ** 2
    assert np.median(missing.sd_m_s2[0, seen]) < 0.15 * largest, "the band says something"


def test_air_drag_shows_only_in_motion(infer):
    missing, _ = infer(1, "--effect", "air_drag", "--strength", "0.7")
    assert missing.acceleration_m_s2.shape == (2, len(missing.time_s))
    at_rest = missing.speed_m_s == 0
    assert at_rest.any()
    assert np.isnan(missing.acceleration_m_s2[at_rest]).all()
    np.testing.assert_array_equal(np.isnan(missing.sd_m_s2), np.isnan(missing.acceleration_m_s2))


def test_of_an_object_that_is_never_seen_nothing_is_said():
    """Object 2 stands somewhere out of the picture."""
    (problem,) = make_trials([HIT]).problems
    seen = problem.observation
    mask = np.stack([np.ones_like(seen.mask[0]), np.zeros_like(seen.mask[1])])
    trials = JointProblem((replace(problem, observation=replace(seen, mask=mask)),))
    fit = best_fit(GradientFitter(trials), seed=0)
    missing = infer_missing_force(trials, Hypothesis((), fit), seed=0)
    assert np.isnan(missing.acceleration_m_s2[1]).all() and np.isnan(missing.sd_m_s2[1]).all()
    assert np.isfinite(missing.acceleration_m_s2[0]).any()


def test_a_start_in_which_nothing_moves_is_left():
    """A wrong effect may have pushed against so much friction that without it all would rest."""
    trials = make_trials([HIT])
    base = Hypothesis((), best_fit(GradientFitter(trials), seed=0))
    stuck = base.fit.z.copy()
    stuck[trials.names.index("k1")] = 4.0
    rests = Hypothesis((), replace(base.fit, z=stuck))
    (alone,), (both,) = views_of(trials, rests), views_of(trials, rests, base)
    assert not alone.moves[0].any() and both.moves[0].any()
    assert both.fit.chi2 < 2 * both.fit.num_values < alone.fit.chi2


@pytest.mark.slow
def test_ripple_in_the_friction_is_a_law_of_the_place(tmp_path):
    clip = simulated(
        tmp_path,
        2,
        "--effects-from",
        str(EXOTIC_FILE),
        "--effect",
        "exotic_ripple",
        "--strength",
        "0.7",
    )
    command = [sys.executable, "-m", "galileo_jax", "diagnose", f"{tmp_path}/c.csv", "--out"]
    subprocess.run([*command, f"{tmp_path}/run"], check=True, capture_output=True)
    verdict = json.loads((tmp_path / "run" / "diagnosis.json").read_text())["verdict"]
    assert verdict["status"] == "law"
    found = re.search(r"k \(1 .*(?:sin|cos)\(2π q/([\d.]+)", verdict["law"])
    truth = json.loads(clip.with_suffix(".truth.json").read_text())
    length = truth["effect_parameters"]["exotic_ripple_length"]
    assert found and float(found[1]) == pytest.approx(length, rel=0.08)


@pytest.mark.slow
def test_nothing_missing_is_nothing(infer):
    missing, _ = infer(3)
    assert covered(missing, 0, 0.0) > LEAST_COVERED


def test_splines_add_up_to_one():
    times = np.linspace(-0.5, 1.5, 41)
    basis = splines(times, np.asarray(0.1), np.asarray(0.9), 8)
    assert basis.shape == (41, 8)
    np.testing.assert_allclose(basis.sum(axis=1), 1.0)


def test_knots_follow_a_curve_that_jumps_between_pieces():
    effect = FreeAcceleration((((0.0, 0.6), (0.6, 1.0)),))
    times = np.linspace(0.0, 0.999, 300)
    wanted = np.where(times < 0.6, -(times**2), 0.5 - times)
    theta = {"m1": np.asarray(0.5)}
    values = effect.knot_values(times, wanted[:, None], 0)[:, 0]
    scene = Surroundings(
        ("a",), 0.3, 9.81, (0.03,), (0.03,), (0.0,), ((0, 0),), (-0.5,), True, (True,)
    )
    for parameter in effect.parameters(scene):
        theta[parameter.name] = np.asarray(parameter.absent)
    for name, z in zip(effect.knots(0), values, strict=True):
        prior = next(p.prior for p in effect.parameters(scene) if p.name == name)
        theta[name] = np.asarray(prior.forward(z))
    force, still = effect.force(theta, scene), np.zeros(1)
    made = [force(State(still, still, np.asarray(t), still < 1))[0] for t in times]
    np.testing.assert_allclose(made, 0.5 * wanted, atol=2e-3)
