"""Of a body that rolls no friction is uneven, whatever the imperfections seem to say."""

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import pytest

from galileo_jax.diagnosis import imperfect_world
from galileo_jax.diagnosis.imperfect_world import ImperfectWorld
from galileo_jax.diagnosis.verdict import Verdict
from tests.found import make_trials


@pytest.mark.parametrize(("rolls", "may_be"), [((True,), False), ((True, False), True), ((), True)])
def test_uneven_friction_is_named_of_what_slides(rolls, may_be, tmp_path, monkeypatch):
    problem = make_trials(tmp_path).problems[0]
    scene = replace(
        problem.model.scene, surroundings=replace(problem.model.scene.surroundings, rolls=rolls)
    )
    own = SimpleNamespace(model=SimpleNamespace(scene=scene))
    judge: Any = SimpleNamespace(trials=SimpleNamespace(problems=[own]))
    asked, none = [], Verdict("none", (), reasons=())

    def answer(_comparison, _table, is_friction):
        asked.append(is_friction)
        return none

    monkeypatch.setattr(imperfect_world, "without_a_name", answer)
    nobody: Any = None
    assert ImperfectWorld(nobody, nobody, (), judge).verdict() is none
    assert asked == [may_be]
