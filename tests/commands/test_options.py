"""What a command reads from a function's source is what Python knows of the function."""

import inspect

import pytest

import galileo_jax as gx
from galileo_jax.commands.command import Parser
from galileo_jax.commands.options import REQUIRED, adder, arguments_of

VERBS = (
    "fit",
    "compare",
    "diagnose",
    "track",
    "simulate",
    "predict",
    "export",
    "train",
    "sweep",
    "next_experiment",
    "discover",
    "explain",
)


@pytest.mark.parametrize("verb", VERBS)
def test_arguments_are_those_of_the_function(verb):
    known = inspect.signature(getattr(gx, verb)).parameters
    read = arguments_of(verb)
    assert read.keys() == known.keys()
    for name, argument in read.items():
        default = (
            REQUIRED if known[name].default is inspect.Parameter.empty else known[name].default
        )
        assert argument.default == default, name
        assert argument.meaning in " ".join((getattr(gx, verb).__doc__ or "").split()), name


def test_an_option_has_the_arguments_type_default_and_meaning():
    parser = Parser()
    add = adder(parser, "simulate")
    add("fps", "hand", "effects_from")
    add("values", option="--set", metavar="NAME=VALUE")
    called = parser.parse_args(["--fps", "60", "--effects-from", "a.py", "--effects-from", "b.py"])
    assert vars(called) == {
        "fps": 60.0,
        "hand": False,
        "effects_from": ["a.py", "b.py"],
        "values": None,
    }
    shown = " ".join(parser.format_help().split())
    assert "frames per second, 5 to 1000 (default 30.0)" in shown
    assert "a hand lets object 1 go (default: off)" in shown
