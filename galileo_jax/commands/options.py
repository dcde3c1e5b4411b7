"""Options of a command: the arguments of the public function that it calls.

Their names, types, defaults and meanings stand once, in the function's signature and docstring.
They are read from its source: importing it would import JAX for a --help.
"""

import ast
import re
from collections.abc import Callable, Mapping
from functools import cache
from importlib.util import find_spec
from pathlib import Path
from typing import Any, NamedTuple

import galileo_jax

ARGUMENT = re.compile(r"^  (\w+): (.+(?:\n    .+)*)", re.MULTILINE)  # in a docstring's Args
WITHOUT = re.compile(r"[;.] None: ([^;]*)")  # what a default of None means
REQUIRED = object()
TYPES: Mapping[str, Any] = {"int": int, "float": float, "str | Path": Path}
METAVARS = {"int": "N", "float": "X", "str | Path": "PATH"}


class Argument(NamedTuple):
    """An argument of a public function.

    Attributes:
      annotation: its type, as text.
      default: `REQUIRED` where it has none.
      meaning: from the docstring, without a full stop.
    """

    annotation: str
    default: Any
    meaning: str


@cache
def arguments_of(name: str) -> Mapping[str, Argument]:
    """By name, of a public function (`fit`)."""
    found = find_spec(galileo_jax.PLACES[name][0])
    assert found is not None and found.origin is not None
    body = ast.parse(Path(found.origin).read_text(encoding="utf-8")).body
    constants = {
        ast.unparse(node.targets[0]): node.value for node in body if isinstance(node, ast.Assign)
    }
    function = next(n for n in body if isinstance(n, ast.FunctionDef) and n.name == name)
    described = (ast.get_docstring(function) or "").partition("Args:\n")[2].split("\n\n")[0]
    meanings = {key: " ".join(text.split()) for key, text in ARGUMENT.findall(described)}
    given = function.args
    required = [None] * (len(given.args) - len(given.defaults))
    positional = zip(given.args, [*required, *given.defaults], strict=True)
    arguments = {}
    for argument, default in (*positional, *zip(given.kwonlyargs, given.kw_defaults, strict=True)):
        annotation = ast.unparse(argument.annotation) if argument.annotation else "str"
        if isinstance(default, ast.Name):
            default = constants[default.id]
        value = REQUIRED if default is None else ast.literal_eval(default)
        meaning = re.sub(r"(?<!\.)\.$", "", meanings[argument.arg])
        arguments[argument.arg] = Argument(annotation, value, meaning)
    return arguments


def adder(parser: Any, function: str, without: str = "none") -> Callable[..., None]:
    """A function that adds options of a public function to a parser, or to a group of it.

    `add("engine", "seed")` adds --engine and --seed. What else it is given goes to argparse's
    `add_argument` in place of what was read; `option` is another name for the option. `without` is
    what a default of None or () means where the docstring does not say it.
    """
    arguments = arguments_of(function)

    def add(*names: str, option: str = "", **given: Any) -> None:
        for name in names:
            written = option or f"--{name.replace('_', '-')}"
            described = _described(arguments[name], without) | given
            if described.get("action") == "append":
                described["help"] += "; may be given several times"
            parser.add_argument(written, dest=name, **described)

    return add


def _described(argument: Argument, without: str) -> dict[str, Any]:
    """What argparse is told of an option."""
    annotation = argument.annotation.removesuffix(" | None")
    found = WITHOUT.search(argument.meaning)
    meaning = WITHOUT.sub("", argument.meaning).replace("`", "").replace("%", "%%")
    if annotation == "bool":
        return {"action": "store_true", "help": f"{meaning} (default: off)"}
    described: dict[str, Any] = {"default": argument.default}
    shown = " (default %(default)s)"
    if argument.default is REQUIRED:
        shown, described = "", {"required": True}
    elif argument.default in (None, (), ""):
        shown = f" (default: {found[1] if found else without})"
    described["help"] = f"{meaning}{shown}"
    if annotation.startswith("Literal["):
        return described | {"choices": ast.literal_eval(annotation.removeprefix("Literal"))}
    if "Sequence[" in annotation:
        return described | {"action": "append", "default": []}
    metavar = METAVARS.get(annotation, "NAME")
    return described | {"type": TYPES.get(annotation, str), "metavar": metavar}
