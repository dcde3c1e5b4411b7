"""The race of candidates ends where a full search does, as far as a verdict may look."""

import numpy as np
import pytest

from galileo_jax.api.simulate import simulate
from galileo_jax.clip.load import load_clip
from galileo_jax.clip.track_csv import read_observation_csv
from galileo_jax.diagnosis import candidates
from galileo_jax.diagnosis.candidate_starts import matched, scattered
from galileo_jax.diagnosis.candidates import Hypothesis, fit_candidates
from galileo_jax.diagnosis.diagnose import fitter_of
from galileo_jax.inference.build_problem import make_joint_problem
from galileo_jax.inference.fits.gradient import GradientFitter, Settings
from galileo_jax.model.effects.registry import make_effects
from tests.precision import in_64_bit

LIBRARY = ("air_drag", "friction_patch", "stribeck", "spring_tether", "viscous_drag")
DECIDING_NATS = 12.8  # behind the best: what luck may make of 3 nats
AGREES_NATS = Settings().settled_in_turn  # a race is not followed any further
SEEDS = {(): 911, ("air_drag",): 912, ("friction_patch",): 913}


def full_search(fitter: GradientFitter, base: Hypothesis) -> np.ndarray:
    """The best evidence of each effect, every start followed to its end by itself, `[effect]`."""
    trials, sets = fitter.trials, [(name,) for name in LIBRARY]
    count = len(trials.model_parameters)
    free = np.stack([trials.free(effects)[:count] for effects in sets])
    bases = [base.fit] * len(sets)
    found = []
    matching, _ = matched(fitter, bases, sets, 0)
    for own, *starts in zip(free, scattered(fitter, bases, free, 0), matching, strict=True):
        z = np.concatenate(starts)
        fits = fitter.fit_from(z, np.tile(own, (len(z), 1)), np.arange(len(z)))
        best = max(fits, key=lambda fit: fit.log_evidence)
        found.append(max(best.log_evidence, fitter.refit(best).log_evidence))
    return np.array(found)


@pytest.mark.slow
@pytest.mark.parametrize("hidden", SEEDS, ids="+".join)
def test_no_candidate_that_may_decide_is_dropped(tmp_path, hidden, monkeypatch):
    monkeypatch.setattr(candidates, "NUM_AT_ONCE", 4)  # five effects are many
    path = tmp_path / "clip.csv"
    simulate(
        path,
        seed=SEEDS[hidden],
        effects=hidden,
        strength=0.6 if hidden else None,
        solver="fine",
        faults=True,
        track_only=True,
    )
    clip = load_clip(path.with_suffix(".yaml"))
    trials = make_joint_problem(
        [clip], [read_observation_csv(path)], effects=make_effects(list(LIBRARY))
    )
    with in_64_bit():
        fitter = fitter_of(trials)
        base = Hypothesis((), fitter.fit(0, effects=()))
        sets = [(name,) for name in LIBRARY]
        shown = []
        raced = fit_candidates(fitter, [base] * len(sets), sets, 0, on_fit=shown.append)
        again = fit_candidates(fitter, [base] * len(sets), sets, 0)
        full = full_search(fitter, base)
    evidence = np.array([one.fit.log_evidence for one in raced])
    assert {one.effects for one in shown} == set(sets)
    assert len(shown) == len(sets) + 1  # the one that promises most, before the race
    assert evidence[sets.index(shown[0].effects)] > shown[0].fit.log_evidence - AGREES_NATS
    np.testing.assert_array_equal(evidence, [one.fit.log_evidence for one in again])
    decides = full > full.max() - DECIDING_NATS
    assert np.all(evidence[decides] > full[decides] - AGREES_NATS)
    assert int(np.argmax(evidence)) == int(np.argmax(full)) or decides.sum() > 1
