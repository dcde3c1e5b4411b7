"""When a verdict is believed."""

import pytest

from galileo_jax.experiment.plan import stands


def law(effect: str, family: str) -> dict:
    return {"status": "law", "effects": [effect], "law": {"family": family}}


PUSH, FORCE = law("law_drag_power_v_all", "power_v"), law("law_drag_force_power_v_all", "power_v")
RUBS = law("law_friction_power_v_all", "power_v")
OTHER = law("law_push_power_t", "power_t")
NAMED = {"status": "named", "effects": ["air_drag"], "law": None}
BRAKED = {"status": "named", "effects": ["magnetic_brake"], "law": None}
OPEN = {"status": "ambiguous", "effects": ["air_drag", "rolling"], "law": OTHER["law"]}
NONE = {"status": "none", "effects": [], "law": None}
OLD = {"status": "law", "effects": ["law_push_power_t"]}


@pytest.mark.parametrize(
    ("rounds", "is_enough"),
    [
        ([], False),
        ([NAMED], False),
        ([NAMED, NAMED], True),
        ([NAMED, BRAKED], False),
        ([NAMED, NONE, NAMED], False),
        ([NONE, NONE], False),
        ([NONE, NONE, NONE], True),
        ([PUSH, PUSH], True),
        ([PUSH, FORCE], True),  # one formula, of an acceleration and of a force
        ([PUSH, OTHER], False),
        ([PUSH, RUBS], False),
        ([OPEN] * 9, False),
        ([OLD, OLD], True),  # of a journal before formulas stood there
    ],
)
def test_a_verdict_stands_by_what_it_says(rounds, is_enough):
    assert stands(rounds) is is_enough
