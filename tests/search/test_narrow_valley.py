"""A narrow, bent valley: friction nearly holds object 1, and all hangs on by how much."""

from typing import Any

import jax.numpy as jnp
import numpy as np
import pytest

from galileo_jax.api.simulate import simulate
from galileo_jax.assembly.build_problem import make_joint_problem
from galileo_jax.clip.load import load_clip
from galileo_jax.clip.track_csv import read_observation_csv
from galileo_jax.diagnosis.stakes import VerdictStakes
from galileo_jax.diagnosis.thresholds import DECISIVE
from galileo_jax.inference.fits.gradient import GradientFitter
from galileo_jax.model.effects.forms import FORMS
from galileo_jax.model.effects.registry import make_effects
from galileo_jax.search.fit import best_fit
from galileo_jax.search.hypothesis import Hypothesis
from galileo_jax.search.loop import search
from galileo_jax.search.table import Table
from tests.precision import in_64_bit

# tan 10 = 0.176; k (1 + a) = 0.062 * 2.7 = 0.166.
CALL: dict[str, Any] = {
    "seed": 157334244,
    "angle": 10.0,
    "effects": ("stribeck",),
    "strength": 0.7,
    "solver": "fine",
    "faults": True,
    "track_only": True,
    "track_noise": 3.3e-4,
}


@pytest.fixture
def slowly_released(tmp_path):
    """Trials of a clip, and the truth's parameters."""
    path = tmp_path / "clip.csv"
    made = simulate(path, **CALL)
    forms = tuple(form for form in FORMS if form.name == "force_at_a_time")
    effects = (*make_effects(["stribeck"]), *forms)
    clip = load_clip(path.with_suffix(".yaml"))
    trials = make_joint_problem([clip], [read_observation_csv(path)], effects=effects)
    (truth,) = made.truths
    return trials, truth | truth["effect_parameters"]


def test_the_search_arrives_where_a_start_at_the_truth_does(slowly_released):
    trials, truth = slowly_released
    with in_64_bit():
        fitter = GradientFitter(trials)
        base = Hypothesis((), best_fit(fitter, 0, effects=()))
        parameters = trials.model_parameters
        count = len(parameters)
        start = base.fit.z[:count].copy()
        for i, parameter in enumerate(parameters):
            if parameter.name in truth:
                start[i] = parameter.prior.inverse(jnp.asarray(truth[parameter.name]))
        free = trials.free(("stribeck",))[:count]
        (from_truth,) = fitter.fit_from(start[None], free[None], np.zeros(1, int))
        table = search(Table.of(fitter, VerdictStakes(trials, False), 0, base), 1)
    named, form = (
        table.entries[frozenset([name])].hypothesis.fit.log_evidence
        for name in ("stribeck", "force_at_a_time")
    )
    assert named > from_truth.log_evidence - 1.0
    assert named > form + DECISIVE
