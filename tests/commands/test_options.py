"""What a command reads from a function's source is what Python knows of the function."""

import inspect
from importlib import import_module

import pytest

import galileo_jax as gx
from galileo_jax.commands.options import REQUIRED, VerbParser, arguments_of

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
    parser = VerbParser("simulate", None)
    parser.add("fps", "hand", "effects_from")
    parser.add("values", option="--set", metavar="NAME=VALUE")
    words = ["--fps", "60", "--effects-from", "a.py", "--effects-from", "b.py"]
    assert parser.asked(words) == {"fps": 60.0, "effects_from": ["a.py", "b.py"]}
    shown = " ".join(parser.format_help().split())
    assert "frames per second, 5 to 1000 (default 30.0)" in shown
    assert "a hand lets object 1 go (default: off)" in shown


@pytest.mark.parametrize(("verb", "more"), [("simulate", ()), ("train", ("test",)), ("label", ())])
def test_every_argument_is_an_option(verb, more):
    parser = import_module(f"galileo_jax.commands.{verb}")._parser()
    options = {action.dest for action in parser._actions} - {"help", *more}
    assert options == arguments_of(verb).keys() - {"on_progress", "cancel"}
