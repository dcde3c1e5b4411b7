"""Where an effect leads only by a better valley of the nuisances, the model without it finds it."""

from dataclasses import replace

import numpy as np
import pytest

from galileo_jax.diagnosis.base_again import better_base, without_effects
from galileo_jax.diagnosis.candidates import Hypothesis
from galileo_jax.diagnosis.diagnosis import Candidate
from galileo_jax.inference.fits.gradient import GradientFit, GradientFitter
from galileo_jax.model.effects import make_effects
from tests.oracle_trials import make_trials
from tests.precision import in_64_bit
from tests.ramp_model import HIT

FOUND, BEHIND = 3.0, 30.0  # nats


@pytest.fixture(scope="module")
def fitted():
    with in_64_bit():
        trials = make_trials([HIT], effects=make_effects(["restitution"]))
        fitter = GradientFitter(trials)
        yield fitter, fitter.fit(0, effects=()), fitter.fit(0, effects=("restitution",))


def candidate(fit: GradientFit, log_evidence: float) -> Candidate:
    return Candidate(
        effects=("restitution",),
        hypothesis=Hypothesis(("restitution",), fit),
        error={},
        score_z=0.0,
        log_evidence=log_evidence,
        log_prior=0.0,
        probability=0.0,
        p_value=None,
        confounded_with=(),
        num_constants=1,
        num_expected=1,
    )


def test_a_missed_valley_is_found_from_the_effect_s_fit(fitted):
    fitter, base, other = fitted
    count = len(fitter.trials.model_parameters)
    worse = base.z.copy()
    worse[:count] += 0.5 * base.free[:count]
    missed = Hypothesis((), replace(base, z=worse, log_evidence=base.log_evidence - BEHIND))
    with in_64_bit():
        found = better_base(fitter, missed, [candidate(other, BEHIND)])
    assert found is not None and found.effects == ()
    assert found.fit.log_evidence == pytest.approx(base.log_evidence, abs=FOUND)
    assert not (found.fit.z[:count] * ~fitter.trials.free(())[:count]).any(), "no effect in it"


def test_a_good_fit_stays(fitted):
    fitter, base, other = fitted
    with in_64_bit():
        assert better_base(fitter, Hypothesis((), base), [candidate(other, 10.0)]) is None


def test_an_effect_that_does_not_lead_is_no_place_to_start(fitted):
    fitter, base, other = fitted
    missed = Hypothesis((), replace(base, log_evidence=-np.inf))
    assert better_base(fitter, missed, [candidate(other, 2.0)]) is None


def test_the_others_make_up_for_the_effect(fitted):
    """Where a nuisance acts as the effect does, it takes over what the effect did."""
    fitter, _, other = fitted
    trials, names = fitter.trials, [p.name for p in fitter.trials.model_parameters]
    e, impact = names.index("restitution"), names.index("impact_restitution")
    count, slope = len(names), np.random.default_rng(0).standard_normal((400, 1))
    z, jacobian = np.zeros_like(other.z), np.zeros((400, count))
    z[e], z[impact] = -1.0, 0.3
    jacobian[:, [e, impact]] = 100.0 * slope * np.array([1.0, 2.0])
    fit = replace(other, z=z, jacobian=jacobian)
    moved = without_effects(trials, Hypothesis(("restitution",), fit))
    prior = trials.model_parameters[e].prior
    value, ahead = (float(prior.forward(np.asarray(at))) for at in (-1.0, -1.0 + 1e-5))
    expected = 0.3 + value / ((ahead - value) / 1e-5) / 2.0
    assert moved.z[impact] == pytest.approx(expected, rel=1e-3)
    assert moved.z[e] == 0.0 and not moved.free[e]
