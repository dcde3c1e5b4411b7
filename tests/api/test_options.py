"""The options of a call are one value, and their defaults are those of the function."""

import inspect
from dataclasses import MISSING, fields

import pytest

import galileo_jax as gx
from galileo_jax.api.options import FitOptions, options_of
from galileo_jax.clip.declaration import Declaration
from galileo_jax.simulation.settings import Settings
from galileo_jax.sweeping.resources import Computing

KINDS = {
    "fit": FitOptions,
    "simulate": Settings,
    "label": Declaration,
    "sweep": Computing,
}


@pytest.mark.parametrize(("verb", "kind"), KINDS.items())
def test_a_call_without_options_has_the_defaults_of_the_options(verb, kind):
    known = inspect.signature(getattr(gx, verb)).parameters
    defaults = {name: one.default for name, one in known.items()}
    asked, plain = vars(options_of(kind, defaults)), vars(kind())
    assert {name: value or None for name, value in asked.items()} == {
        name: value or None for name, value in plain.items()
    }, "() and {} are both empty"
    for one in fields(kind):
        assert one.name in known, "an argument"
        assert one.default is not MISSING or one.default_factory is not MISSING


def test_none_is_the_default_and_what_was_checked_goes_first():
    given = {one.name: None for one in fields(Computing)} | {"engine": "ray", "more": 1}
    assert options_of(Computing, given, workers=3) == Computing("ray", workers=3)
