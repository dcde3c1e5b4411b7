"""`discrepancy="rough"`: what a user gets of imperfections whose sizes are inferred."""

import json

import pytest

import galileo_jax as gx
from galileo_jax.report.fit_text import fit_quality
from galileo_jax.runtime.errors import InputError

SEED = 3


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    path = tmp_path_factory.mktemp("rough") / "slide.csv"
    truth = gx.simulate(path, scenario="incline", seed=SEED, track_only=True, track_noise=2e-4)
    return path, truth.truths[0]


@pytest.fixture(scope="module")
def fit(made):
    return gx.fit(made[0], discrepancy="rough", seed=0)


def test_sizes_stand_in_the_result_and_nothing_is_unusual(made, fit):
    """Friction as it was, and a size, an interval and a sentence for each imperfection."""
    entry = fit.parameters["k1"]
    assert entry["q025"] < made[1]["k1"] < entry["q975"]
    found = fit.result["imperfections"]
    assert {"friction_roughness", "lasting_error"} <= set(found)
    assert "contact_push" not in found  # there is no second body
    for one in found.values():
        assert 0 < one["q025"] < one["mean"] < one["q975"]
        assert one["ordinary"]
    said = " ".join(fit_quality(fit.result))
    assert "See where it fails" not in said
    assert "{size}" not in said


def test_a_saved_run_has_the_sizes_again(fit, tmp_path):
    """Loaded, it is compared with the same covariance: the same p-value."""
    fit.save(tmp_path / "run")
    assert json.loads((tmp_path / "run" / "result.json").read_text())["imperfections"]
    again = gx.load_run(tmp_path / "run")
    assert again.problem.sizes == pytest.approx(fit.problem.sizes)
    first, second = gx.compare(fit), gx.compare(again)
    assert first.p_value > 0.01
    assert second.p_value == pytest.approx(first.p_value, abs=0.1)


def test_trials_may_differ(tmp_path):
    """By how much friction differs between two is among the imperfections; a joint run loads."""
    path = tmp_path / "both.csv"
    made = gx.simulate(
        path, scenario="incline", seed=SEED, series=2, track_only=True, track_noise=2e-4
    )
    fit = gx.fit(list(made.clips), discrepancy="rough", seed=0)
    entry = fit.result["imperfections"]["friction_between_trials"]
    assert 0 < entry["q025"] < entry["q975"]
    fit.save(tmp_path / "run", report=False)
    assert gx.load_run(tmp_path / "run").problem.names == fit.problem.names


def test_options_that_do_not_go_with_it_are_refused(made):
    """The network and the thesis know nothing of sizes."""
    with pytest.raises(InputError, match="--discrepancy rough: of --method grad or mh"):
        gx.fit(made[0], discrepancy="rough", method="cnn")


def test_an_exact_track_is_mostly_told_by_the_exact_fit(made):
    """By default both worlds are fitted; where hardly anything is imperfect intervals are as in
    the exact one, up to the share of the other."""
    both, exact = gx.fit(made[0], seed=0), gx.fit(made[0], discrepancy="none", seed=0)
    share = both.result["probability_imperfect"]
    assert 0.0 <= share < 0.6
    assert "imperfections" not in both.result
    assert both.parameters["k1"]["sd"] < 1.5 * exact.parameters["k1"]["sd"]


def test_what_a_hidden_drag_leaves_is_more_than_usual(tmp_path):
    """It passes for uneven friction in a fit, which says so; compare shows where it fails."""
    path = tmp_path / "drag.csv"
    gx.simulate(path, seed=SEED, effects={"air_drag": {}}, strength=1, track_only=True)
    fit = gx.fit(path, seed=0)
    assert "galileo diagnose" in fit_quality(fit.result)[-1]
    check = gx.compare(fit)
    assert not check.is_adequate
    assert any(path.failing_s is not None for path in check.paths)
