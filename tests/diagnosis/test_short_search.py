"""What could be confused with a pair: found by a short search, where slopes mean nothing."""

import numpy as np
import pytest

from galileo_jax.api.simulate import simulate
from galileo_jax.clip.load import load_clip
from galileo_jax.clip.track_csv import read_observation_csv
from galileo_jax.diagnosis.candidates import Hypothesis, reduced
from galileo_jax.diagnosis.score_tests import best_gains
from galileo_jax.diagnosis.short_search import short_search
from galileo_jax.inference.build_problem import make_joint_problem
from galileo_jax.inference.fits.ends import BEHIND_IN_SEARCH
from galileo_jax.inference.fits.gradient import GradientFitter
from galileo_jax.model.effects.registry import make_effects
from tests.precision import in_64_bit

TRUTH, RIVAL = ("release_delay", "rolling"), ("release_delay", "frame_rate")
LIBRARY = (*TRUTH, "frame_rate", "surface_friction", "restitution", "table_tilt", "viscous_drag")


@pytest.fixture
def late_and_rolling(tmp_path):
    """Trials of a clip in which two effects are hidden; as a wrong frame rate one hardly shows."""
    path = tmp_path / "clip.csv"
    simulate(
        path,
        seed=4711,
        angle=28.0,
        effects={"release_delay": {"release_delay": 0.34}, "rolling": {"rolling": 0.88}},
        track_noise=1e-4,
        fps=60.0,
        solver="fine",
        faults=True,
        track_only=True,
    )
    clip = load_clip(path.with_suffix(".yaml"))
    return make_joint_problem(
        [clip], [read_observation_csv(path)], effects=make_effects(list(LIBRARY))
    )


def test_a_short_search_finds_what_slopes_do_not(late_and_rolling):
    trials, count = late_and_rolling, len(late_and_rolling.model_parameters)
    with in_64_bit():
        fitter = GradientFitter(trials)
        rival = Hypothesis(RIVAL, fitter.fit(0, effects=RIVAL))
        start = reduced(trials, rival, RIVAL[:1]).fit
        pairs = [(RIVAL[0], name) for name in LIBRARY if name not in RIVAL]
        at, free = rival.fit.z[None, :count], rival.fit.free[None, :count]
        lowest = float(fitter.search_costs(at, free)[0])
        ends, costs = short_search(fitter, [start] * len(pairs), pairs, 0, lowest)
        has = np.stack([trials.free(pair)[:count] for pair in pairs])
        there = fitter.search_costs(ends, has)
        gains = best_gains(trials, start, pairs, 0)
    near = [pairs[i][1] for i in np.flatnonzero(costs < costs.min() + BEHIND_IN_SEARCH)]
    assert set(near) == {"rolling", "surface_friction"}
    assert costs.min() < lowest
    np.testing.assert_allclose(there, costs, rtol=1e-6)
    assert pairs[int(np.argmax(gains))][1] not in near
