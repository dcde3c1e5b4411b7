"""An effect whose fit was missed is found from where a pair, or its own formula, has all else."""

import json
from dataclasses import replace

import numpy as np
import pytest

from galileo_jax.api.simulate import simulate
from galileo_jax.clip.load import load_clip
from galileo_jax.clip.track_csv import read_observation_csv
from galileo_jax.diagnosis import race as race_module
from galileo_jax.diagnosis.candidates import Hypothesis
from galileo_jax.diagnosis.diagnose import fitter_of
from galileo_jax.diagnosis.diagnosis import Candidate
from galileo_jax.diagnosis.laws.grammar import FACTORS, Structure
from galileo_jax.diagnosis.laws.in_model import _with_laws
from galileo_jax.diagnosis.laws.source import class_source, name_of
from galileo_jax.diagnosis.library_again import singles_beside, singles_of_pairs
from galileo_jax.diagnosis.race import Race
from galileo_jax.diagnosis.verdict import LAPLACE_NATS
from galileo_jax.inference.build_problem import make_joint_problem
from galileo_jax.inference.fits.gradient import GradientFitter
from galileo_jax.model.effects.registry import make_effects
from galileo_jax.model.parameters import inverse
from tests.diagnosis.test_verdict import candidate
from tests.precision import in_64_bit

LIBRARY = ("air_drag", "stribeck")
DECAY = next(factor for factor in FACTORS if factor.label == "decay_v")
STRIBECK_S_FORMULA = Structure("friction", False, (DECAY,))


def from_truth(trials, values, effects) -> Hypothesis:
    """Fitted from the truth; the same parameters have other names in a formula."""
    parameters = trials.model_parameters
    z = inverse(parameters, np.array([values.get(p.name, p.absent) for p in parameters]))
    free = trials.free(effects)[: len(parameters)]
    fitter = GradientFitter(trials)
    (fit,) = fitter.fit_from(np.where(free, z, 0.0)[None], free[None], np.zeros(1, int))
    return Hypothesis(effects, fit, trials)


def fitted(hypothesis: Hypothesis, base: Hypothesis) -> Candidate:
    name = "+".join(hypothesis.effects)
    known = replace(candidate(name, 0.0), hypothesis=hypothesis)
    return replace(known, log_evidence=hypothesis.evidence_over(base))


@pytest.fixture(scope="module")
def rubs_at_low_speed(tmp_path_factory):
    """A race over a clip with Stribeck friction, the stuck fits of two effects, and the truth."""
    path = tmp_path_factory.mktemp("clip") / "clip.csv"
    simulate(path, seed=921, effects=("stribeck",), strength=0.9, angle=20.0, track_only=True)
    truth = json.loads(path.with_suffix(".truth.json").read_text())
    clip = load_clip(path.with_suffix(".yaml"))
    trials = make_joint_problem([clip], [read_observation_csv(path)], effects=make_effects(LIBRARY))
    with in_64_bit():
        fitter = fitter_of(trials)
        base = Hypothesis((), fitter.fit(0, effects=()))
        # As if the search had ended where it began.
        stuck = [
            fitted(Hypothesis((name,), replace(base.fit, free=trials.free((name,)))), base)
            for name in LIBRARY
        ]
        yield Race(fitter, base, False, 0, lambda _: None), stuck, truth


def test_from_its_own_formula(rubs_at_low_speed):
    race, stuck, truth = rubs_at_low_speed
    own = truth["effect_parameters"]
    source, name = class_source(STRIBECK_S_FORMULA, []), name_of(STRIBECK_S_FORMULA)
    beside = _with_laws(race.fitter.trials, [STRIBECK_S_FORMULA], [source])
    values = {name: own["stribeck"], f"{name}_speed": own["stribeck_speed"]}
    with in_64_bit():
        law = fitted(from_truth(beside, truth | values, (name,)), race.base)
        found = singles_beside(race, law, stuck)
    (better,) = [c for c in found if c.name == "stribeck"]
    assert law.log_evidence > 10.0  # it is there to be seen
    assert better.log_evidence > law.log_evidence - LAPLACE_NATS
    assert better.score_z == stuck[1].score_z


def test_from_a_pair_that_has_it(rubs_at_low_speed):
    race, stuck, truth = rubs_at_low_speed
    pair = ("stribeck", "air_drag")
    with in_64_bit():
        values = truth | truth["effect_parameters"] | {"air_drag": 1e-3}
        both = from_truth(race.fitter.trials, values, pair)
        known = fitted(both, race.base)
        found = singles_of_pairs(race, [known, *stuck])
        again = singles_of_pairs(race, [known, *found])
    assert [c.name for c in found] == ["stribeck"]
    assert found[0].log_evidence > known.log_evidence - LAPLACE_NATS
    assert again == []


@pytest.mark.parametrize("is_explained", [True, False])
def test_while_no_fit_is_explained_by_noise_any_may_matter(
    rubs_at_low_speed, monkeypatch, is_explained
):
    race, (first, other), _ = rubs_at_low_speed
    asked = []

    def capture(fitter, bases, sets, seed, matters, *rest):
        asked.append(matters)
        return []

    monkeypatch.setattr(race_module, "fit_candidates", capture)
    monkeypatch.setattr(GradientFitter, "is_explained", lambda *_: is_explained)
    with in_64_bit():
        Race(race.fitter, race.base, False, 0, lambda _: None)([race.base], [("stribeck",)])
    fit = first.hypothesis.fit
    ahead = replace(first.hypothesis, fit=replace(fit, log_evidence=fit.log_evidence + 1000.0))
    assert asked[0]([ahead, other.hypothesis]).tolist() == [True, not is_explained]
