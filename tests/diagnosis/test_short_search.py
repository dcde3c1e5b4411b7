"""What could be confused with a pair: found by a short search, where slopes mean nothing."""

from types import SimpleNamespace
from typing import Any
from unittest.mock import MagicMock

import numpy as np
import pytest

from galileo_jax.api.simulate import simulate
from galileo_jax.clip.load import load_clip
from galileo_jax.clip.track_csv import read_observation_csv
from galileo_jax.diagnosis import fitted_pairs as pairs_module
from galileo_jax.diagnosis.candidates import Hypothesis, reduced
from galileo_jax.diagnosis.score_tests import best_gains
from galileo_jax.diagnosis.short_search import short_search
from galileo_jax.inference.build_problem import make_joint_problem
from galileo_jax.inference.fits.ends import BEHIND_IN_SEARCH
from galileo_jax.inference.fits.gradient import GradientFitter
from galileo_jax.model.effects.registry import make_effects
from tests.diagnosis.test_verdict import candidate
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


def test_what_could_be_confused_with_a_better_pair_is_searched_for_once_more(monkeypatch):
    """From the best pair so far; a pair that was searched for is not searched for again."""
    odds = {"a+b": 50.0, "b+c": 60.0, "c+d": 70.0, "d+e": 80.0}
    searched, started = [], []

    def search(fitter, bases, pairs, seed, lowest):
        searched.append({frozenset(pair) for pair in pairs})
        costs = [
            0.0 if {"+".join(pair), "+".join(pair[::-1])} & odds.keys() else 99.0 for pair in pairs
        ]
        return np.arange(float(len(pairs)))[:, None], np.array(costs)

    def race(bases, sets, starts=None):
        started.append((sets, starts))
        return [
            candidate("+".join(sorted(pair)), odds.get("+".join(sorted(pair)), 1.0))
            for pair in sets
        ]

    fitter = SimpleNamespace(
        trials=SimpleNamespace(model_parameters=()), search_costs=lambda z, free: np.zeros(1)
    )
    stub: Any = MagicMock(side_effect=race, seed=0, fitter=fitter)
    monkeypatch.setattr(pairs_module, "best_gains", lambda *_: np.array([0, 9, 0, 0, 0.0]))
    monkeypatch.setattr(pairs_module, "reduced", lambda trials, best, kept: best)
    monkeypatch.setattr(pairs_module, "short_search", search)
    monkeypatch.setattr(pairs_module, "pairs_to_try", lambda *_: [[("a", "b")]])
    found = pairs_module.fitted_pairs(stub, [candidate("a", 40.0)], list("abcde"))
    assert [one.name for one in found] == ["c+d", "b+c", "a+b"]
    assert frozenset("bc") in searched[0] and frozenset("cd") in searched[1]
    assert len(searched) == 2 and not searched[0] & searched[1]
    sets, starts = started[1]
    assert [tuple(pair) for pair in sets] == [("b", "c")] and starts[0].shape == (1, 1)


def test_a_pair_without_either_effect_of_the_best_one_is_found(monkeypatch):
    """From the better of its single effects; what comes nowhere near is not fitted."""
    odds = {"a+b": 50.0, "c+d": 90.0}
    fitted = []

    def search(fitter, bases, pairs, seed, lowest):
        costs = [0.0 if set(pair) == {"c", "d"} else 99.0 for pair in pairs]
        return np.arange(float(len(pairs)))[:, None], np.array(costs)

    def race(bases, sets, starts=None):
        fitted.extend(zip(bases, sets, strict=True))
        return [
            candidate("+".join(sorted(pair)), odds.get("+".join(sorted(pair)), 1.0))
            for pair in sets
        ]

    fitter = SimpleNamespace(
        trials=SimpleNamespace(model_parameters=()), search_costs=lambda z, free: np.zeros(1)
    )
    stub: Any = MagicMock(side_effect=race, seed=0, fitter=fitter)
    monkeypatch.setattr(pairs_module, "best_gains", lambda *_: np.array([0, 9, 0, 0, 0.0]))
    monkeypatch.setattr(pairs_module, "reduced", lambda trials, best, kept: best)
    monkeypatch.setattr(pairs_module, "short_search", search)
    monkeypatch.setattr(pairs_module, "pairs_to_try", lambda *_: [[("a", "b")], [], []])
    singles = [candidate(name, 40.0 - i) for i, name in enumerate("adc")]
    found = pairs_module.fitted_pairs(stub, singles, list("abcd"))
    assert [one.name for one in found] == ["c+d", "a+b"]
    base, pair = fitted[-1]
    assert tuple(pair) == ("d", "c") and base is singles[1].hypothesis


def test_pairs_that_add_nothing_to_an_effect_lead_nowhere(monkeypatch):
    """a alone has more evidence than with anything: only pairs without a are looked for."""
    searched, fits = [], []

    def search(fitter, bases, pairs, seed, lowest):
        searched.extend(frozenset(pair) for pair in pairs)
        return np.zeros((len(pairs), 1)), np.full(len(pairs), 99.0)

    def race(bases, sets, starts=None):
        return [candidate("+".join(sorted(pair)), 39.0) for pair in sets]

    fitter = SimpleNamespace(
        trials=SimpleNamespace(model_parameters=()),
        search_costs=lambda z, free: np.zeros(1),
        fit=lambda *_, **__: fits.append(1),
    )
    stub: Any = MagicMock(side_effect=race, seed=0, fitter=fitter)
    monkeypatch.setattr(pairs_module, "best_gains", lambda *_: np.array([0, 9, 0, 0, 0.0]))
    monkeypatch.setattr(pairs_module, "short_search", search)
    monkeypatch.setattr(pairs_module, "pairs_to_try", lambda *_: [[("a", "b"), ("a", "c")], [], []])
    singles = [candidate(name, 60.0 - 20 * i) for i, name in enumerate("abc")]
    found = pairs_module.fitted_pairs(stub, singles, list("abcd"))
    assert {one.name for one in found} == {"a+b", "a+c"}
    assert set(searched) <= {frozenset("bc"), frozenset("bd"), frozenset("cd")} and not fits


@pytest.mark.parametrize(("leads", "expected"), [("a+b", ["b+c", "c+d"]), ("a", [])])
def test_what_is_like_the_pair_that_leads_in_the_end_is_looked_for(monkeypatch, leads, expected):
    """However it was found: two effects may pass for another two."""
    odds = {"b+c": 60.0, "c+d": 70.0, "d+e": 80.0}

    def search(fitter, bases, pairs, seed, lowest):
        known = ["+".join(sorted(pair)) in odds for pair in pairs]
        return np.zeros((len(pairs), 1)), np.where(known, 0.0, 99.0)

    def race(bases, sets, starts=None):
        names = ["+".join(sorted(pair)) for pair in sets]
        return [candidate(name, odds.get(name, 1.0)) for name in names]

    fitter = SimpleNamespace(
        trials=SimpleNamespace(model_parameters=()), search_costs=lambda z, free: np.zeros(1)
    )
    stub: Any = MagicMock(side_effect=race, seed=0, fitter=fitter)
    monkeypatch.setattr(pairs_module, "reduced", lambda trials, best, kept: best)
    monkeypatch.setattr(pairs_module, "short_search", search)
    table = [candidate(leads, 50.0), candidate("d", 40.0)]
    found = pairs_module.pairs_like_the_best(stub, table, list("abcde"))
    assert [one.name for one in found] == expected
