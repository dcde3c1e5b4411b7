"""A fit that has missed its valley is led there across the rims of restitution and gap."""

import numpy as np
import pytest

from galileo_jax.api.simulate import simulate
from galileo_jax.assembly.build_problem import make_joint_problem
from galileo_jax.clip.load import load_clip
from galileo_jax.clip.track_csv import read_observation_csv
from galileo_jax.inference.fits.gradient import GradientFitter
from galileo_jax.model.effects.registry import make_effects
from galileo_jax.search.hypothesis import Hypothesis
from galileo_jax.search.loop import search
from galileo_jax.search.moves import jolt
from galileo_jax.search.table import Entry, Stakes, Table
from tests.precision import in_64_bit

PATCH = ("friction_patch",)
STUCK_NATS, FOUND_NATS = 30.0, 1.0
NUM_TRIED, SPREAD_Z = 8, 0.8


def test_a_stuck_fit_is_led_to_where_a_start_at_the_truth_goes(tmp_path):
    path = tmp_path / "clip.csv"
    call = {"effects": PATCH, "strength": 1.0, "track_only": True, "track_noise": 1e-4}
    (told,) = simulate(path, seed=1, **call).truths
    truth = told | told["effect_parameters"]
    clip = load_clip(path.with_suffix(".yaml"))
    seen = [read_observation_csv(path)]
    trials = make_joint_problem([clip], seen, effects=make_effects(list(PATCH)))
    parameters = trials.model_parameters
    with in_64_bit():
        fitter = GradientFitter(trials)
        start = np.zeros(len(parameters))
        for i, parameter in enumerate(parameters):
            if parameter.name in truth:
                start[i] = parameter.prior.inverse(np.asarray(truth[parameter.name]))
        of_effect = trials.brought_by(PATCH[0])
        starts = np.tile(start, (NUM_TRIED + 1, 1))
        away = np.random.default_rng(0).standard_normal((NUM_TRIED, len(of_effect)))
        starts[1:, of_effect] += SPREAD_Z * away
        free = trials.free(PATCH)[: len(parameters)]
        rows = np.arange(len(starts))
        fits = fitter.polish(starts, np.tile(free, (len(starts), 1)), rows)
        right = fits[0]
        behind = [f for f in fits.values() if f.log_evidence < right.log_evidence - STUCK_NATS]
        stuck = max(behind, key=lambda one: one.log_evidence)
        none = trials.free(())[: len(parameters)]
        base = fitter.fit_from(start[None] * none, none[None], np.zeros(1, int))[0]
        table = Table.of(fitter, Stakes(), 0, Hypothesis((), base))
        table = table.with_entry(Entry(Hypothesis(PATCH, stuck), (stuck,)))
        found = search(table, 1, moves=(jolt.propose,)).entries[frozenset(PATCH)].hypothesis.fit
        assert found.log_evidence == pytest.approx(right.log_evidence, abs=FOUND_NATS)
