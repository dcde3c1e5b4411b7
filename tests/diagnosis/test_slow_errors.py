"""What slow errors of a track add to a hypothesis, and what that makes of a law."""

from types import SimpleNamespace

import numpy as np
import pytest
from scipy.stats import multivariate_normal

from galileo_jax.diagnosis import slow_errors
from galileo_jax.diagnosis.diagnosis import Verdict
from galileo_jax.diagnosis.slow_errors import SIZES, SlowErrors, evidence_added, unless_slow_errors
from galileo_jax.diagnosis.verdict import ranked
from tests.diagnosis.test_law_verdict import law
from tests.diagnosis.test_verdict import DECISIVE, EDGE, candidate


def test_the_evidence_is_that_of_the_whole_normal_distribution():
    rng = np.random.default_rng(3)
    jacobian, patterns = rng.standard_normal((12, 2)), rng.standard_normal((12, 4))
    at_prior = 2.0 * rng.standard_normal(12)
    cover = np.eye(12) + jacobian @ jacobian.T
    z = -np.linalg.solve(np.eye(2) + jacobian.T @ jacobian, jacobian.T @ at_prior)
    found = evidence_added(at_prior + jacobian @ z, jacobian, z, patterns)
    mean = np.zeros(12)
    without = multivariate_normal.logpdf(at_prior, mean, cover)  # pyright: ignore
    for size, added in zip(SIZES, found, strict=True):
        wider = cover + size**2 * patterns @ patterns.T
        expected = multivariate_normal.logpdf(at_prior, mean, wider) - without  # pyright: ignore
        assert added == pytest.approx(expected, abs=1e-8)


def _verdict(monkeypatch, adds: float, before: Verdict, noise: str = "camera") -> Verdict:
    monkeypatch.setattr(slow_errors, "_beside", lambda *_: SlowErrors(adds, 0.7, 0.4))
    trials = SimpleNamespace(problems=[SimpleNamespace(noise=noise)])
    one = SimpleNamespace(of=lambda trials: trials, fit=None)
    table = [
        SimpleNamespace(
            **{
                name: getattr(c, name)
                for name in ("title", "name", "log_odds", "is_form", "law", "effects")
            },
            hypothesis=one,
        )
        for c in ranked([law(50.0), candidate("air_drag", 40.0, 1e-3)])
    ]
    return unless_slow_errors(trials, one, before, table, DECISIVE)  # pyright: ignore


@pytest.mark.parametrize(
    ("adds", "expected"), [(10.0 - DECISIVE - EDGE, "law"), (10.0 - DECISIVE + EDGE, "unknown")]
)
def test_a_law_must_beat_slow_errors_beside_an_effect(monkeypatch, adds, expected):
    after = _verdict(monkeypatch, adds, Verdict("law", ("law_1",)))
    assert after.status == expected
    assert ("slow_errors" in [why.rule for why in after.reasons]) == (expected == "unknown")


def test_positions_that_no_camera_measured_have_none(monkeypatch):
    assert _verdict(monkeypatch, 99.0, Verdict("law", ("law_1",)), "bodies").status == "law"


def test_what_slow_errors_would_explain_is_said(monkeypatch):
    after = _verdict(monkeypatch, 10.0 + DECISIVE, Verdict("unknown", ()))
    assert after.reasons[-1].numbers["beside"] == "air_drag"
    assert not _verdict(monkeypatch, 10.0, Verdict("unknown", ())).reasons
