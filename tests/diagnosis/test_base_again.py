"""Where an effect leads only by a better valley of the nuisances, the model without it finds it."""

from dataclasses import replace

import numpy as np
import pytest

from galileo_jax.diagnosis.base_again import better_base
from galileo_jax.diagnosis.candidates import Hypothesis
from galileo_jax.diagnosis.diagnosis import Candidate
from galileo_jax.inference.fits.gradient import GradientFit, GradientFitter
from galileo_jax.model.effects import make_effects
from tests.oracle_trials import make_trials
from tests.precision import in_64_bit
from tests.ramp_model import HIT

FOUND, BEHIND = 0.5, 30.0  # nats


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
