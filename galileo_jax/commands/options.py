"""Options of a command: the arguments of the public function that it calls.

Their names, types, defaults and meanings stand once, in the function's signature and docstring.
They are read from its source: importing it would import JAX for a --help.
"""

import argparse
import ast
import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from functools import cache, partial
from importlib.util import find_spec
from pathlib import Path
from typing import Any, NamedTuple

import galileo_jax
from galileo_jax.commands import command
from galileo_jax.rollout.engine_names import ENGINES
from galileo_jax.runtime.errors import InputError
from galileo_jax.runtime.known_names import option_of

ARGUMENT = re.compile(r"^  (\w+): (.+(?:\n    .+)*)", re.MULTILINE)  # in a docstring's Args
WITHOUT = re.compile(r"[;.] None: ([^;]*)")  # what a default of None means
REQUIRED = object()
TYPES: Mapping[str, Any] = {"int": int, "float": float, "str | Path": Path}
METAVARS = {"int": "N", "float": "X", "str | Path": "PATH"}


class Argument(NamedTuple):
    """An argument of a public function."""

    annotation: str  # its type, as text
    default: Any  # `REQUIRED` where it has none
    meaning: str  # from the docstring, without a full stop
    is_positional: bool  # it need not be given by its name


@cache
def arguments_of(name: str) -> Mapping[str, Argument]:
    """By name, of a public function (`fit`)."""
    found = find_spec(galileo_jax.PLACES[name][0])
    assert found is not None and found.origin is not None
    body = ast.parse(Path(found.origin).read_text(encoding="utf-8")).body
    function = next(n for n in body if isinstance(n, ast.FunctionDef) and n.name == name)
    described = (ast.get_docstring(function) or "").partition("Args:\n")[2].split("\n\n")[0]
    meanings = {key: " ".join(text.split()) for key, text in ARGUMENT.findall(described)}
    given = function.args
    required = [None] * (len(given.args) - len(given.defaults))
    positional = zip(given.args, [*required, *given.defaults], strict=True)
    arguments = {}
    for argument, default in (*positional, *zip(given.kwonlyargs, given.kw_defaults, strict=True)):
        annotation = ast.unparse(argument.annotation) if argument.annotation else "str"
        value = REQUIRED if default is None else ast.literal_eval(default)
        meaning = re.sub(r"(?<!\.)\.$", "", meanings[argument.arg])
        arguments[argument.arg] = Argument(annotation, value, meaning, argument in given.args)
    return arguments


def whole_number(least: int) -> Callable[[str], int]:
    """Returns a parser of whole numbers for `add_argument(type=...)`."""

    def parse(text: str) -> int:
        try:
            value = int(text)
        except ValueError:
            value = least - 1
        if value < least:
            raise argparse.ArgumentTypeError(f"{text!r} is not a whole number, {least} or more")
        return value

    return parse


EVERYWHERE: Mapping[str, Mapping[str, Any]] = {
    "effects_from": {"metavar": "FILE.py"},
    "seed": {"type": whole_number(0)},
    "engine": {"choices": ENGINES, "metavar": None},
    "pixels_per_metre": {"metavar": "SCALE"},
    "fps": {"metavar": "HZ"},
    "ramp_angle": {"metavar": "DEG"},
    "track_units": {"metavar": "UNIT"},
    "effects": {"metavar": "A,B", "help": "effects in the model (default: none)"},
    "tracks": {"nargs": "+", "metavar": "CLIP", "help": "video, its yaml, or a csv track"},
}
"""What argparse is told of arguments that mean the same in every function."""


class _Once(argparse._StoreAction):
    """Stores a value; refuses another one, of which argparse would take the last."""

    def __call__(
        self,
        parser: argparse.ArgumentParser,
        namespace: argparse.Namespace,
        values: Any,
        option_string: str | None = None,
    ) -> None:
        if option_string is not None and hasattr(namespace, self.dest):
            several = "; names are separated by commas" if "," in str(self.metavar) else ""
            parser.error(f"{option_string}: given twice{several}")
        super().__call__(parser, namespace, values, option_string)


class VerbParser(command.Parser):
    """The parser of `galileo VERB`.

    Args:
      verb: as it is called.
      description: of the call.
      *examples: calls, shown at the end of --help.
      function: the public function whose arguments are the options; that of the verb's name.
      without: what a default of None or () means where the docstring does not say it.
    """

    def __init__(
        self,
        verb: str,
        description: str | None,
        *examples: str,
        function: str = "",
        without: str = "none",
    ):
        super().__init__(
            prog=f"galileo {verb}",
            description=description,
            argument_default=argparse.SUPPRESS,
            formatter_class=argparse.RawDescriptionHelpFormatter,
            epilog="\n  ".join(("examples:", *examples)),
        )
        for name in (None, "store"):
            self.register("action", name, _Once)
        self._function, self._without = function or verb, without

    def asked(self, argv: Sequence[str]) -> dict[str, Any]:
        """What the call gives, by the function's arguments; it has the defaults of all others."""
        return vars(self.parse_args(argv))

    def add(self, *names: str, to: Any = None, option: str = "", **given: Any) -> None:
        """Adds arguments of the function: `add("engine", "seed")` adds --engine and --seed.

        `given` goes to argparse's `add_argument` in place of what was read; `option` is another
        name for the option, or one for an argument that needs none; `to` a group of options.
        """
        for name in names:
            argument = arguments_of(self._function)[name]
            words = [name] if argument.is_positional and not option else [option or option_of(name)]
            described = _described(argument, self._without, bool(option))
            described |= {**EVERYWHERE.get(name, {}), **given}
            if described.get("action") == "append":
                described["help"] += "; may be given several times"
            if words != [name]:
                described["dest"] = name
            (to or self).add_argument(*words, **described)

    def group(self, *titles: str) -> Callable[..., None]:
        """`add`, to a group of options with this title and description."""
        return partial(self.add, to=self.add_argument_group(*titles))

    def out(self, meaning: str) -> None:
        """Adds --out, a folder that only the command knows of."""
        self.add_argument("--out", type=Path, metavar="DIR", help=meaning)


def refuse(
    asked: Mapping[str, Any], names: Iterable[str], why: str, of: Callable[[str], str] = option_of
) -> None:
    """Refuses options that a call gives and would ignore, even with their default."""
    for name in names:
        if name in asked:
            raise InputError(f"{of(name)}: {why}")


def _described(argument: Argument, without: str, is_option: bool) -> dict[str, Any]:
    """What argparse is told of an argument."""
    annotation = argument.annotation.removesuffix(" | None")
    found = WITHOUT.search(argument.meaning)
    meaning = WITHOUT.sub("", argument.meaning).replace("`", "").replace("%", "%%")
    if argument.is_positional and not is_option:
        return {"help": meaning, "type": TYPES.get(annotation, str)}
    if annotation == "bool":
        given = {"action": "store_true", "default": argparse.SUPPRESS}
        return given | {"help": f"{meaning} (default: off)"}
    shown = f" (default {argument.default})"
    if argument.default is REQUIRED:
        shown = ""
    elif argument.default in (None, (), ""):
        shown = f" (default: {found[1] if found else without})"
    described = {"help": f"{meaning}{shown}", "required": argument.default is REQUIRED}
    if annotation.startswith("Literal["):
        return described | {"choices": ast.literal_eval(annotation.removeprefix("Literal"))}
    if "Sequence[" in annotation:
        return described | {"action": "append"}
    metavar = METAVARS.get(annotation, "NAME")
    return described | {"type": TYPES.get(annotation, str), "metavar": metavar}
