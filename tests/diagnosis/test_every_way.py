"""The best formula is fitted in every way: as a push and as friction, on one object and on all."""

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from galileo_jax.diagnosis.laws import fit_formulas, rank_formulas
from galileo_jax.diagnosis.laws.fit_formulas import fitted_laws
from galileo_jax.diagnosis.laws.grammar import Structure
from galileo_jax.diagnosis.laws.rank_formulas import NUM_OF_FAMILY, suggestions
from tests.diagnosis.test_rank_formulas import FACTOR, RANGES, TIMES, clip_that_lacks, made


@pytest.fixture
def clips(monkeypatch) -> Any:
    """One clip in which object 1 is pushed on over a bump."""
    away = (TIMES - 0.5) / 0.1
    seen = clip_that_lacks(3.0 * away * np.exp(-(away**2)))
    monkeypatch.setattr(rank_formulas, "ranges_of", lambda clips: RANGES)
    scene: Any = seen.view.model.scene.surroundings
    scene.has_surface, scene.names = True, ("object1", "object2")
    return [seen]


def test_a_family_has_more_ways_than_are_screened(clips):
    family = Structure("push", False, (FACTOR["slope_q"],)).family
    found = suggestions(clips, family)
    ways = {(one.structure.nature, one.structure.is_on_all) for one in found}
    assert {("push", False), ("friction", False)} <= ways and len(ways) > NUM_OF_FAMILY
    assert {one.structure.family for one in found} == {family}
    assert [one.score for one in found] == sorted((one.score for one in found), reverse=True)


def test_a_push_that_the_screening_passed_over_is_fitted(monkeypatch):
    """Where the screening takes both places of a family for changes of friction."""
    ways = [("friction", False), ("friction", True), ("push", False), ("push", True)]
    family = [made("slope_q", 90.0 - i, *way) for i, way in enumerate(ways)]
    evidence = {"push": 285.0, "friction": 275.0}

    def fitted(trials, near, found, clips):
        return [
            SimpleNamespace(
                structure=one.structure,
                constants=dict,
                hypothesis=SimpleNamespace(
                    fit=SimpleNamespace(log_evidence=evidence[one.structure.nature])
                ),
            )
            for one in found
        ]

    screened = {None: family[:2], "pull_q": family}

    def suggestions(clips, name=None):
        return screened[name]

    monkeypatch.setattr(fit_formulas, "suggestions", suggestions)
    monkeypatch.setattr(fit_formulas, "_fitted", fitted)
    monkeypatch.setattr(fit_formulas, "without_twins", lambda laws: laws)
    none: Any = None
    found = fitted_laws(none, none, [])
    assert len(found) == len(family), "each once"
    assert found[0].structure == Structure("push", False, (FACTOR["slope_q"],))
