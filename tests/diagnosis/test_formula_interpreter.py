"""Proposed formulas as numbers: the same motion as their classes, and no program of their own."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from galileo_jax.diagnosis.laws.formula_interpreter import (
    NAMES,
    ActingFormulas,
    LawAsForce,
    LawAsFriction,
    codes_of,
)
from galileo_jax.diagnosis.laws.grammar import CLASS, law_class, name_of, structures
from galileo_jax.model.effects.effect import State
from galileo_jax.rollout.engine_jax import _roll_out_batch
from galileo_jax.rollout.engine_path import EnginePath
from galileo_jax.runtime.precision import in_float64
from tests.ramp_model import HIT, make_model

PRIOR = "LogNormal(0.3, 0.5)"
EVERY = {name_of(one): one for one in structures(has_surface=True, num_objects=2)}
MODEL = make_model(HIT, 1.0)


def law_of(structure) -> Any:
    constants = ", ".join(f'"{name}": ("1", {PRIOR})' for name in structure.constants)
    source = CLASS.format(
        text="",
        name=name_of(structure),
        nature=structure.nature,
        is_on_all=structure.is_on_all,
        constants=constants,
        arguments="".join(f", {name}" for name in structure.constants),
        code=structure.code,
    )
    return law_class(source)()


@pytest.mark.parametrize("structure", EVERY.values(), ids=EVERY)
def test_a_formula_as_numbers_does_what_its_class_does(structure):
    scene = MODEL.scene.surroundings
    law, name = law_of(structure), name_of(structure)
    values = np.linspace(0.3, 0.7, len(structure.constants))
    codes, slots = codes_of(structure)
    numbers = codes.copy()
    numbers[slots] = [-0.8, *values]
    masses = {"m1": np.array(0.5), "m2": np.array(0.2)}
    theta = masses | dict(zip(NAMES, map(np.asarray, numbers), strict=True))
    own = {f"{name}_{key}": np.array(x) for key, x in zip(structure.constants, values, strict=True)}
    own |= masses | {name: np.array(-0.8)}
    path, speed = np.array([-0.2, 0.35]), np.array([-0.4, 0.6])
    state = State(path, speed, np.array(0.31), path < 0)
    if structure.nature == "friction":
        k = np.array([0.3, 0.2])
        friction = LawAsFriction().friction(theta, scene)
        assert friction is not None
        found = friction(state, k)
        expected = law.friction(own, scene)(state, k)
    else:
        found = LawAsForce().force(theta, scene)(state)
        expected = law.force(own, scene)(state)
    np.testing.assert_allclose(found, expected, rtol=1e-12)
    assert np.any(np.abs(expected) > 1e-9)


def motions_of(*names: str):
    """Rollouts with each of some formulas, by their classes and as numbers."""
    laws = tuple(law_of(EVERY[name]) for name in names)
    model = replace(MODEL, effects=laws)
    theta = np.tile([p.absent for p in model.parameters], (len(names) + 1, 1))
    theta[:, [model.index("k1"), model.index("k2")]] = 0.2
    for row, name in zip(theta, names, strict=False):
        row[model.index(name)] = 0.7
    engines = EnginePath(model), EnginePath(model, ActingFormulas(model, EVERY))
    return [engine.simulate(theta)[0] for engine in engines]


@in_float64
def test_rollouts_are_the_same_and_other_formulas_compile_nothing():
    _roll_out_batch._programs.cache_clear()
    first = ("law_push_decay_t", "law_friction_power_t_all", "law_drag_force_power_v_all")
    for own, as_numbers in zip(*motions_of(*first), strict=True):
        np.testing.assert_allclose(as_numbers, own, atol=1e-12)
    known = _roll_out_batch._programs.cache_info().currsize
    other = ("law_push_pulse_q", "law_friction_linear_q", "law_drag_power_v")
    own, as_numbers = motions_of(*other)
    np.testing.assert_allclose(as_numbers, own, atol=1e-12)
    assert np.ptp(own[..., -1], axis=0).max() > 1e-3  # they act
    assert _roll_out_batch._programs.cache_info().currsize == known + 1  # that of the classes
