"""`galileo next` of a run whose last model has a law: its hypotheses are those of the library."""

import json

import numpy as np
import pytest

import galileo_jax as gx
from galileo_jax.api.next_experiment import _read
from galileo_jax.assembly.build_problem import with_library
from galileo_jax.experiment.hypothesis_probabilities import FILE, Belief, Beliefs, write_beliefs
from galileo_jax.model.effects.registry import effect_names

pytestmark = pytest.mark.usefixtures("effects_restored", "x64")

LAW = '''"""a = c t."""

from galileo_jax.model.effects.law import Law
from galileo_jax.model.effects.registry import register


@register
class ProposedLaw(Law):
    """a = c t, object 1."""

    name = "law_push_power_t"
    nature, is_on_all = "push", False
    constants = {}

    def formula(self, t, q, v, xp):
        return t
'''


def test_a_law_of_the_last_model_is_no_hypothesis(tmp_path):
    gx.simulate(tmp_path / "a.csv", seed=11, track_only=True)
    fit = gx.fit(tmp_path / "a.csv")
    seen = fit.measurements
    trials = with_library([one.clip for one in seen], [one.observation for one in seen], "auto")
    run = tmp_path / "run"
    fit.save(run / "model", report=False)
    (run / "proposed_effect.py").write_text(LAW)
    record = json.loads((run / "model" / "result.json").read_text())
    record["effects_from"] = [str(run / "proposed_effect.py")]
    (run / "model" / "result.json").write_text(json.dumps(record))
    (run / "diagnosis.json").write_text(json.dumps({"clips": [str(tmp_path / "a.csv")]}))
    count = len(trials.names)
    belief = Belief((), 0.0, np.zeros(count), np.zeros(count, bool), np.eye(count))
    write_beliefs(run / FILE, trials, Beliefs((belief,), 3.0))
    _, read, beliefs, _ = _read(run)
    assert "law_push_power_t" in effect_names()
    assert read.names == trials.names and len(beliefs.of) == 1
