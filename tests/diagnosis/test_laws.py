"""Formulas: what they are worth as effects, as text and as a file."""

from typing import Any

import numpy as np
import pytest

from galileo_jax.diagnosis.diagnosis import Law as FoundLaw
from galileo_jax.diagnosis.laws.grammar import (
    FACTORS,
    Structure,
    class_source,
    law_class,
    name_of,
    proposed_file,
    structures,
    without_one_factor,
)
from galileo_jax.model.effects import registry
from galileo_jax.model.effects.effect import State
from galileo_jax.model.effects.registry import effect_names, load_file, make_effects
from tests.ramp_model import HIT, make_model

FACTOR = {factor.label: factor for factor in FACTORS}
DRAG = Structure("drag", True, (FACTOR["power_v"],))
SCENE = make_model(HIT, 1.0).scene.surroundings


def state(path, speed, time=0.5):
    path, speed = np.asarray(path), np.asarray(speed)
    return State(path, speed, np.asarray(time), path < 0)


def theta(structure, strength, **constants):
    name = name_of(structure)
    values = {f"{name}_{key}": np.asarray(value) for key, value in constants.items()}
    masses = {"m1": np.asarray(0.5), "m2": np.asarray(0.2)}
    return {name: np.asarray(strength), **values, **masses}


def effect(structure) -> Any:
    return law_class(class_source(structure, {}))()


def test_a_drag_of_a_power():
    force = effect(DRAG).force(theta(DRAG, 0.6, n=1.5), SCENE)
    found = force(state([-0.1, 0.2], [0.9, -0.4]))
    expected = np.array([-0.5 * 0.6 * 0.9**1.5, 0.2 * 0.6 * 0.4**1.5])
    np.testing.assert_allclose(found, expected, rtol=2e-3)


@pytest.mark.parametrize("nature", ["push", "drag", "drag_force", "friction"])
def test_a_drag_takes_energy(nature):
    """A push and a change of friction may have either sign."""
    strength, *_ = effect(Structure(nature, True, (FACTOR["decay_t"],))).parameters(SCENE)
    assert (float(strength.prior.forward(-3.0)) > 0.0) == nature.startswith("drag")


def test_a_drag_of_the_same_force_on_all():
    same = Structure("drag_force", True, (FACTOR["power_v"],))
    found = effect(same).force(theta(same, 0.6, n=2.0), SCENE)(state([-0.1, 0.2], [0.9, 0.9]))
    np.testing.assert_allclose(found, -0.5 * 0.6 * 0.81, rtol=1e-3)


def test_a_push_on_object_1_alone():
    push = Structure("push", False, (FACTOR["power_t"],))
    found = effect(push).force(theta(push, 0.8, p=0.5), SCENE)(state([-0.1, 0.2], [0.9, 0.4]))
    np.testing.assert_allclose(found, [0.5 * 0.8 * np.sqrt(0.5), 0.0])


def test_a_friction_that_heats_never_pushes():
    heating = Structure("friction", True, (FACTOR["power_t"],))
    law = effect(heating).friction(theta(heating, -4.0, p=1.0), SCENE)
    np.testing.assert_allclose(law(state([-0.1, 0.2], [1, 1], 0.1), np.full(2, 0.3)), 0.18)
    np.testing.assert_allclose(law(state([-0.1, 0.2], [1, 1], 0.5), np.full(2, 0.3)), 0.0)


def has_place_of_its_own(structure):
    """A place or moment that is uniform over what a clip shows."""
    return any(c.prior is None for _, c in structure.constants.values())


@pytest.mark.parametrize(
    "structure", [s for s in structures(True, 2) if not has_place_of_its_own(s)], ids=name_of
)
def test_no_strength_is_no_law(structure):
    """All formulas are Python, and with a strength of zero there is nothing."""
    made, where = effect(structure), state([-0.1, 0.2], [0.9, -0.4])
    values = {p.name: np.asarray(p.absent) for p in made.parameters(SCENE)}
    values |= {"m1": np.asarray(0.5), "m2": np.asarray(0.2)}
    if structure.nature == "friction":
        k = np.full(2, 0.3)
        np.testing.assert_array_equal(made.friction(values, SCENE)(where, k), k)
    else:
        np.testing.assert_array_equal(made.force(values, SCENE)(where), 0.0)


def test_formulas_are_told_apart_by_their_shape():
    drag = Structure("drag", False, (FACTOR["power_v"],))
    assert drag.family == DRAG.family
    assert Structure("drag", True, (FACTOR["decay_t"], FACTOR["power_v"])).family != DRAG.family


def test_one_factor_may_do_nothing():
    both = Structure("drag", False, (FACTOR["decay_t"], FACTOR["power_v"]))
    decay, power = both.constants
    values = {"c": -3.5, decay: 0.3, power: 0.03}
    push, drag = without_one_factor(both, values)
    assert push == (Structure("push", False, (FACTOR["decay_t"],)), {decay: 0.3, "c": 3.5})
    assert drag == (Structure("drag", False, (FACTOR["power_v"],)), {power: 0.03, "c": -3.5})
    assert without_one_factor(DRAG, {"c": 1.0, "n": 2.0}) == []


def test_constants_of_the_same_name_keep_their_factor():
    both = Structure("push", True, (FACTOR["pulse_t"], FACTOR["pulse_q"]))
    values = {"c": 0.4, "moment": 1.0, "width": 2.0, "place": 3.0, "width2": 4.0}
    assert set(both.constants) == set(values) - {"c"}
    found = without_one_factor(both, values)
    assert [constants for _, constants in found] == [
        {"moment": 1.0, "width": 2.0, "c": 0.4},
        {"place": 3.0, "width": 4.0, "c": 0.4},
    ]


def test_as_a_physicist_writes_it():
    assert DRAG.text({"c": 0.62, "n": 1.5}) == "a = -0.62 |v|^1.5 sign(v), all objects"


def test_the_file_is_an_effect_of_its_own(tmp_path, monkeypatch):
    effect_names()  # what is registered here is gone after the test
    entries = registry.effect_registry._entries
    monkeypatch.setattr(registry.effect_registry, "_entries", dict(entries))
    text = "a = -0.6 |v|^1.5 sign(v), all objects"
    source = class_source(DRAG, {}).replace(name_of(DRAG), "law_of_a_test")
    found = FoundLaw(text, DRAG.family, source, {"c": "0.6", "n": "1.5"})
    path = tmp_path / "proposed_effect.py"
    path.write_text(proposed_file(found, ["clip.csv"]))
    assert path.read_text().startswith(f'"""{text}\n')
    assert len(class_source(DRAG, {}).splitlines()) <= 10
    assert load_file(path) == ("law_of_a_test",)
    (made,) = make_effects(["law_of_a_test"])
    assert [p.name for p in made.parameters(SCENE)] == ["law_of_a_test", "law_of_a_test_n"]
