"""Which pairs are searched from more starts, and which of them go into the table."""

from dataclasses import dataclass, replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from galileo_jax.diagnosis import wide_search
from galileo_jax.diagnosis.verdict import NUM_JOINED
from galileo_jax.inference.fits.gradient import Settings

PAIRS = [("a", "b"), ("a", "c"), ("b", "c"), ("c", "d")]
KNOWN = 10.0


@dataclass(frozen=True)
class Pair:
    effects: tuple[str, ...]
    hypothesis: SimpleNamespace
    score_z: float


def pair(effects, log_evidence=KNOWN):
    return Pair(effects, SimpleNamespace(fit=SimpleNamespace(log_evidence=log_evidence)), 7.0)


@pytest.mark.parametrize("gain", [-5.0, 2.0, 250.0])
def test_a_better_valley_of_the_best_pairs_is_taken(gain, monkeypatch):
    searched, started = [], []

    class Wide:
        def __init__(self, trials, settings):
            assert settings.num_starts >= 4 * Settings().num_starts
            assert settings.num_refined >= 4 * Settings().num_refined

        def fit(self, seed, effects):
            searched.append(effects)
            return SimpleNamespace(log_evidence=KNOWN + gain, z=np.array([1.0, 2.0, 9.0]))

    def race(bases, sets, starts):
        started.append((sets[0], starts[0].tolist()))
        return [replace(pair(sets[0], KNOWN + gain), score_z=0.0)]

    monkeypatch.setattr(wide_search, "GradientFitter", Wide)
    trials = SimpleNamespace(model_parameters=("p", "q"))
    fitter = SimpleNamespace(trials=trials, settings=Settings())
    caller: Any = type("Caller", (SimpleNamespace,), {"__call__": staticmethod(race)})
    candidates: Any = [pair(("a",)), *map(pair, PAIRS)]
    found = wide_search.widely_searched(caller(fitter=fitter, seed=0, base=None), candidates)
    assert searched == PAIRS[:NUM_JOINED], "the best pairs, no single effects"
    assert [c.effects for c in found] == (PAIRS[:NUM_JOINED] if gain > 100 else [])
    assert all(c.score_z == 7.0 for c in found)
    assert started == [(c.effects, [[1.0, 2.0]]) for c in found]
