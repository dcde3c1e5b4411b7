"""One error, everywhere: `fit`, `compare`, the residuals, the pages and the sentences agree.

Tracks of every scenario, with and without a hidden effect, at several noises. The default suite
takes one of each scenario; the slow ones make fifty.
"""

import re

import numpy as np
import pytest

import galileo_jax as gx
from galileo_jax.report.diagnosis_text import adequacy
from galileo_jax.report.fit_text import chi2_text, fit_quality

HIDDEN = {
    "ramp": ("air_drag", "friction_patch", "restitution"),
    "multi": ("air_drag",),
    "incline": ("air_drag", "stribeck"),
    "fall": ("air_drag",),
    "flight": ("air_drag",),
    "liquid": (),
    "spring": ("air_drag",),
}
NOISES_M = (1e-4, 4e-4)
SAME = 1e-6


def cases(first, count):
    return [(list(HIDDEN)[i % len(HIDDEN)], i) for i in range(first, first + count)]


@pytest.mark.parametrize(
    ("scenario", "case"),
    [
        pytest.param(*each, marks=[pytest.mark.slow] if slow else [])
        for each in cases(0, 50)
        for slow in [each[0] == "multi" or each[1] >= len(HIDDEN)]
    ],
)
def test_nothing_contradicts_anything_else(tmp_path, scenario, case):
    rng = np.random.default_rng([2611, case])
    hidden = HIDDEN[scenario]
    effects = (hidden[case % len(hidden)],) if hidden and case % 2 else ()
    gx.simulate(
        tmp_path / "seen.csv",
        scenario=scenario,
        seed=int(rng.integers(1 << 30)),
        effects=effects,
        strength=float(rng.uniform(0.05, 0.8)) if effects else None,
        track_noise=float(rng.uniform(*NOISES_M)),
        track_only=True,
    )
    fit = gx.fit(tmp_path / "seen.csv", seed=case)
    check = gx.compare(fit)
    if not all(entry["ordinary"] for entry in fit.result.get("imperfections", {}).values()):
        fit = gx.fit(tmp_path / "seen.csv", seed=case, discrepancy="none")  # as is compared
    error = fit.result["error"]

    for name, value in check.error.items():
        assert error[name] == pytest.approx(value, rel=SAME, nan_ok=True), name
    whole = check.cells[check.cells.phase == "whole"]
    if set(whole.axis) >= {"x", "y"}:
        assert np.sqrt((whole.noise**2).mean()) == pytest.approx(error["noise"], rel=0.05)
    white = fit.residuals[["x_white", "y_white"]].to_numpy()
    shown = np.concatenate([[path.along, path.across] for path in check.paths], axis=1)
    assert np.nansum(shown**2) == pytest.approx(np.nansum(white**2), rel=SAME)

    chi2, said = error["chi2_per_dof"], " ".join(fit_quality(fit.result))
    (stated,) = re.findall(r"freedom ([\d.]+)", chi2_text(error))
    assert float(stated) == pytest.approx(chi2, abs=0.006)
    lead = adequacy(check.document)
    fails = [path for path in check.paths if path.failing_s is not None]
    assert ("not adequate" in lead) == (not check.is_adequate)
    if check.is_adequate:
        assert not fails, "an interval is shaded, but the model is said to be adequate"
        assert "See where it fails" not in said or "times as large as stated" in lead
    else:
        assert check.found.pulls or fails, "the model fails, and nowhere is it shown"
    if "imperfections" not in fit.result and error["explained_by_noise"]:
        assert "the size of" in said or "smaller" in said
