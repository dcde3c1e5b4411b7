"""What the data alone say of the power that the name of a drag takes for known."""

from typing import Any

import pytest

from galileo_jax.api.simulate import simulate
from galileo_jax.clip.load import load_clip
from galileo_jax.clip.track_csv import read_observation_csv
from galileo_jax.diagnosis.candidates import candidates_of
from galileo_jax.diagnosis.constants_with_names import with_known_constants
from galileo_jax.diagnosis.diagnosis import Verdict
from galileo_jax.diagnosis.stakes import VerdictStakes
from galileo_jax.inference.build_problem import make_joint_problem
from galileo_jax.inference.fits.gradient import GradientFitter
from galileo_jax.model.effects.forms import FORMS
from galileo_jax.model.effects.registry import effect_names, make_effects
from galileo_jax.search.fit import best_fit
from galileo_jax.search.hypothesis import Hypothesis
from galileo_jax.search.loop import search
from galileo_jax.search.table import Table
from tests.precision import in_64_bit

FORM = next(form for form in FORMS if form.name == "drag_of_a_power")
NAMED = Verdict("named", ("viscous_drag",))


def judged(tmp_path, noise_m):
    """The verdict on a track with linear drag, and what the table says of form over name."""
    path = tmp_path / "clip.csv"
    effects = {"viscous_drag": {"viscous_drag": 0.3}}
    simulate(
        path, seed=3, angle=20.0, effects=effects, track_noise=noise_m, fps=60.0, track_only=True
    )
    clip = load_clip(path.with_suffix(".yaml"))
    both = (*make_effects(["viscous_drag"]), FORM)
    trials = make_joint_problem([clip], [read_observation_csv(path)], effects=both)
    with in_64_bit():
        fitter = GradientFitter(trials)
        base = Hypothesis((), best_fit(fitter, 0, effects=()))
        stakes = VerdictStakes(trials, False)
        table = candidates_of(search(Table.of(fitter, stakes, 0, base), 1))
        evidence = {c.name: c.log_evidence for c in table}
        ahead = evidence["viscous_drag"] - evidence[FORM.name]
        return with_known_constants(trials, NAMED, table, 0), ahead


def test_where_a_clip_hardly_tells_the_power_its_interval_is_said(tmp_path):
    found, ahead = judged(tmp_path, 1e-3)
    assert ahead < 3
    (why,) = found.reasons
    numbers: Any = why.numbers
    assert why.rule == "constant_by_data" and numbers["value"] == 1
    assert numbers["low"] < 1 < numbers["high"]
    assert numbers["high"] - numbers["low"] > 0.3
    assert "the power of the speed is 1; from these data alone" in why.sentence


def test_where_a_clip_tells_the_power_nothing_is_said(tmp_path):
    found, ahead = judged(tmp_path, 5e-6)
    assert ahead > 3 and found.reasons == ()


@pytest.mark.parametrize(
    "verdict",
    [Verdict("ambiguous", ("viscous_drag", FORM.name)), Verdict("named", ("stribeck", "rolling"))],
)
def test_other_verdicts_stay_as_they_are(verdict):
    trials: Any = None  # nothing is asked of them
    assert with_known_constants(trials, verdict, (), 0) is verdict


def test_forms_are_those_of_effects_that_there_are():
    for form in FORMS:
        assert set(form.named_values) <= set(effect_names())
        assert bool(form.named_values) == bool(form.constant) == bool(form.constant_words)
