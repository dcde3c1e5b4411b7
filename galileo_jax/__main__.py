"""The console script: `galileo VERB ...`, or `galileo FILE ...` for `galileo explain FILE ...`."""

import os
import sys
from collections.abc import Sequence
from importlib import import_module
from textwrap import indent

from galileo_jax import __version__
from galileo_jax.commands import command
from galileo_jax.commands.stop import end
from galileo_jax.runtime.errors import InputError
from galileo_jax.runtime.known_names import did_you_mean

VERBS = (
    ("fit", "estimate masses and friction coefficients from clips"),
    ("compare", "test whether the model describes a clip, and where it fails"),
    ("diagnose", "find the missing effect, add it, watch the error fall"),
    ("track", "track the objects of a clip; check the overlay by eye"),
    ("studio", "the same with the mouse, on a page in your browser"),
    ("explain", "all of it in one call, in words: what galileo FILE does"),
    ("look", "show what is understood of a table or film"),
    ("label", "write points and scale into a clip's yaml"),
    ("simulate", "simulate a clip whose truth is known"),
    ("predict", "predict how a fitted scene goes on after its clip"),
    ("toss", "estimate friction and bounce of a cube from measured tosses"),
    ("next", "choose the most informative next experiment"),
    ("discover", "let a lab run experiments until the verdict is settled"),
    ("export", "write tracks and fits as csv, parquet or netCDF"),
    ("train", "train and test the neural networks"),
    ("sweep", "evaluate many clips, with several methods, from one config"),
    ("effects", "list the effects that a model can contain"),
    ("scenarios", "list the kinds of motion that a clip can show"),
)

USAGE = "usage: galileo FILE, galileo VERB ..., galileo VERB --help, galileo --version"
EXPLAIN = "explain"  # the verb of a call without one


def main(argv: Sequence[str]) -> int | None:
    """Hands the arguments after the verb to that verb's module, imported only now.

    Raises:
      InputError: no verb and no file, or a verb that there is not.
    """
    if not argv:
        raise InputError(f"no file and no verb given; {_known()}; see galileo --help")
    verb, *rest = argv
    if verb in ("-h", "--help"):
        print(_help())
        return 0
    if verb == "--version":
        print(f"galileo {__version__}")
        return 0
    # Read when NumPy is imported. Matrices here are small: its threads would wait for each other.
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    if verb not in dict(VERBS):
        explain = import_module(f"galileo_jax.commands.{EXPLAIN}")
        is_option_first = verb.startswith("--") and any(map(explain.looks_like_a_file, rest))
        if explain.looks_like_a_file(verb) or is_option_first:
            return explain.main(argv)
        hint = did_you_mean(verb, dict(VERBS)) or ";"
        raise InputError(f"unknown verb {verb!r}{hint} {_known()}")
    return import_module(f"galileo_jax.commands.{verb}").main(rest)


def _known() -> str:
    return "known: " + ", ".join(verb for verb, _ in VERBS)


def _help() -> str:
    return f"{USAGE}\n\n{indent(command.in_columns(dict(VERBS)), '  ')}"


def cli(*verb: str) -> None:
    """The console script's entry point, and that of `python -m galileo_jax.VERB`."""
    end(command.run(lambda words: main([*verb, *words]), sys.argv[1:]))


if __name__ == "__main__":
    cli()
