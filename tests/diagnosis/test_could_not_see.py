"""What a clip could not have shown: strengths by slopes."""

import json
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from galileo_jax.api.clips import load
from galileo_jax.api.simulate import simulate
from galileo_jax.assembly.build_problem import with_library
from galileo_jax.diagnosis.could_not_see import smallest_shown, unseen
from galileo_jax.diagnosis.diagnosis import Diagnosis, Round, Verdict
from galileo_jax.diagnosis.document import diagnosis_document
from galileo_jax.diagnosis.thresholds import CONVINCING
from galileo_jax.inference.fits.gradient import GradientFitter
from galileo_jax.inference.joint_problem import JointProblem
from galileo_jax.measurement.measure import measure
from galileo_jax.model.parameters import LogNormal, Normal, Uniform
from galileo_jax.search.fit import best_fit
from galileo_jax.search.hypothesis import Hypothesis
from tests.found import candidate_of, comparison_of

EFFECTS = ("air_drag", "rolling", "ramp_angle")


def test_where_all_is_linear_the_strength_is_what_the_formula_gives():
    """A broad prior, many residuals: |d|^2 / 2 = CONVINCING + log(prior width / sd) + z^2 / 2."""
    power, sd = 1e4, 1.0
    found = smallest_shown(power, 1e9, Normal(0.0, sd), 0.0, 0.0, CONVINCING)
    needed = CONVINCING + 0.5 * np.log(1 + power * sd**2) + 0.5 * found**2
    assert found == pytest.approx(np.sqrt(2 * needed / power), rel=0.2)  # the grid of strengths


@pytest.mark.parametrize("prior", [LogNormal(0.3, 1.2), Normal(0.0, 0.2), Uniform(0.0, 1.0)])
def test_better_data_show_less(prior):
    found = [
        smallest_shown(power, 100.0, prior, 0.0, -3.0, CONVINCING) for power in (1e3, 1e4, 1e5)
    ]
    assert np.inf > found[0] > found[1] > found[2] > 0


def test_what_is_less_probable_must_be_stronger_and_few_residuals_tell_less():
    plain = smallest_shown(1e4, 100.0, Normal(0.0, 0.5), 0.0, 0.0, CONVINCING)
    rare = smallest_shown(1e4, 100.0, Normal(0.0, 0.5), 0.0, -8.0, CONVINCING)
    few = smallest_shown(1e4, 10.0, Normal(0.0, 0.5), 0.0, 0.0, CONVINCING)
    assert np.inf > rare > plain and np.inf > few > plain


def test_what_no_strength_shows_has_none():
    assert smallest_shown(0.1, 100.0, Normal(0.0, 0.2), 0.0, -3.0, CONVINCING) == np.inf


def made(folder: Path, noise: float) -> JointProblem:
    """A simulated board without effects; its model has three."""
    simulate(folder / "a.csv", scenario="incline", seed=3, track_only=True, track_noise=noise)
    seen = measure(load(folder / "a.csv"))
    return with_library([seen.clip], [seen.observation], "rigid", EFFECTS)


def seen_in(trials: JointProblem) -> Mapping:
    base = Hypothesis((), best_fit(GradientFitter(trials), 0, effects=()))
    return unseen(trials, base, dict.fromkeys(EFFECTS, -3.0), 0).could_not_see


def test_each_effect_of_the_library_has_a_strength_and_a_unit(tmp_path):
    seen = seen_in(made(tmp_path, 0.0003))
    assert set(seen) == set(EFFECTS)
    assert seen["air_drag"]["unit"] == "1/m", "nobody weighed it"
    assert 0.001 < seen["air_drag"]["strength"] < 1.0
    assert seen["rolling"]["strength"] is None, "friction takes its place on one slope"


def test_of_a_slope_the_change_of_friction_is_its_formula(tmp_path):
    """The acceleration was seen: k = tan a - seen / (g cos a), so dk = (1 + k tan a) da."""
    trials = made(tmp_path, 0.0003)
    base = Hypothesis((), best_fit(GradientFitter(trials), 0, effects=()))
    found = unseen(trials, base, {"ramp_angle": -3.0}, 0).could_not_see["ramp_angle"]
    k1 = float(trials.theta(base.fit.z, base.fit.free)[trials.names.index("k1")])
    slope = np.tan(np.radians(20.0))
    change = found["changes"]["k1"]
    assert abs(change["by"]) == pytest.approx((1 + k1 * slope) * found["strength"], rel=0.03)
    assert abs(change["sds"]) > 3.0


def test_what_is_hidden_changes_a_number_by_what_is_said(tmp_path):
    """A drag of just this strength is what the fit without it has its friction off by."""
    told = seen_in(made(tmp_path, 0.0003))["air_drag"]
    m1 = json.loads((tmp_path / "a.truth.json").read_text())["m1"]
    drag = {"air_drag": {"air_drag": told["strength"] * m1}}
    path = tmp_path / "hidden.csv"
    truth = simulate(path, scenario="incline", seed=3, track_only=True, effects=drag).truths[0]
    seen = measure(load(path))
    trials = with_library([seen.clip], [seen.observation], "rigid", EFFECTS)
    fit = best_fit(GradientFitter(trials), 0, effects=())
    k1 = float(trials.theta(fit.z, fit.free)[trials.names.index("k1")])
    assert truth["k1"] - k1 == pytest.approx(told["changes"]["k1"]["by"], rel=0.2)


def test_larger_errors_hide_more(tmp_path):
    few, many = (seen_in(made(tmp_path, noise))["air_drag"] for noise in (0.0002, 0.002))
    assert 3.0 < many["strength"] / few["strength"] < 30.0


@pytest.mark.parametrize(("p_value", "is_said"), [(0.5, True), (1e-9, False)])
def test_nothing_is_said_where_the_last_model_does_not_describe_the_clip(
    tmp_path, p_value, is_said
):
    trials = made(tmp_path, 0.0003)
    base = Hypothesis((), best_fit(GradientFitter(trials), 0, effects=()))
    rounds = (Round(base, comparison_of(trials, p_value)),)
    candidates = tuple(replace(candidate_of(trials, name, 0.1), log_prior=-3.0) for name in EFFECTS)
    found = Diagnosis(rounds, candidates, Verdict("none", ()))
    seen = diagnosis_document(trials, found, 0)["could_not_see"]
    assert set(seen) == (set(EFFECTS) if is_said else set())


def test_an_effect_that_would_show_is_in_question_where_it_was_hidden(tmp_path):
    """By slopes alone, beside the fit without it."""
    for strength, expected in ((0.0, ()), (0.3, ("air_drag",))):
        path = tmp_path / f"{strength}.csv"
        hidden = {"air_drag": {"air_drag": strength}} if strength else ()
        simulate(path, scenario="incline", seed=3, track_only=True, effects=hidden)
        seen = measure(load(path))
        trials = with_library([seen.clip], [seen.observation], "rigid", EFFECTS)
        base = Hypothesis((), best_fit(GradientFitter(trials), 0, effects=()))
        found = unseen(trials, base, dict.fromkeys(EFFECTS, -3.0), 0).in_question
        assert found[:1] == expected
