"""The runner: `python -m benchmarks NAME [arguments]`; without a name, a line about each.

A benchmark is a module here with a `main`, which prints a table and returns the figures of the last
line, one of JSON. Its parameters are the arguments: keyword-only ones are options.
"""

import argparse
import ast
import importlib
import inspect
import types
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, Literal, get_args, get_origin

from benchmarks import tables
from galileo_jax.commands import command
from galileo_jax.runtime.errors import InputError


def main(argv: Sequence[str]) -> int | None:
    """Runs one benchmark, or lists all."""
    if not argv or argv[0] in ("-h", "--help"):
        print("python -m benchmarks NAME [--help]\n")
        print(*(f"{name:<18}{line}" for name, line in summaries().items()), sep="\n")
        return None
    name, *arguments = argv
    if name not in summaries():
        raise InputError(f"unknown benchmark {name!r}; known: {', '.join(summaries())}")
    try:
        module = importlib.import_module(f"benchmarks.{name}")
    except ModuleNotFoundError as error:
        raise InputError(f"{name} needs the package {error.name}") from error
    parser = command.Parser(
        prog=f"python -m benchmarks {name}",
        description=module.__doc__,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    declare(parser, module.main)
    given = vars(parser.parse_args(arguments))
    figures = module.main(**{k: tuple(v) if isinstance(v, list) else v for k, v in given.items()})
    if figures is not None:
        tables.finish(name, figures)
    return None


def summaries() -> dict[str, str]:
    """The first line of every benchmark's docstring, by name; nothing is imported."""
    found = {}
    for path in sorted(Path(__file__).parent.glob("[!_]*.py")):
        tree = ast.parse(path.read_text(encoding="utf-8"))
        if any(isinstance(one, ast.FunctionDef) and one.name == "main" for one in tree.body):
            found[path.stem] = (ast.get_docstring(tree) or "").split("\n")[0]
    return found


def declare(parser: argparse.ArgumentParser, function: Callable[..., Any]) -> None:
    """Declares the parameters of a function; of a tuple of words the default has all choices."""
    for name, one in inspect.signature(function).parameters.items():
        has_default = one.default is not one.empty
        given = _kind(one.annotation)
        if has_default:
            given |= {"default": one.default, "help": f"default: {one.default}"}
        if given.get("nargs") and given["type"] is str and one.default:
            given.setdefault("choices", one.default)
        if one.kind is one.KEYWORD_ONLY:
            given |= {} if has_default else {"required": True}
            parser.add_argument(f"--{name.replace('_', '-')}", **given)
        else:
            given |= {"nargs": "*" if given.get("nargs") else "?"} if has_default else {}
            parser.add_argument(name, **given)


def _kind(annotation: Any) -> dict[str, Any]:
    """What argparse is told of a type."""
    arguments = [one for one in get_args(annotation) if one not in (type(None), Ellipsis)]
    if get_origin(annotation) is types.UnionType:
        return _kind(arguments[0])
    if get_origin(annotation) is Literal:
        return {"choices": arguments, "type": type(arguments[0])}
    if get_origin(annotation) is tuple:
        return {"nargs": "+"} | _kind(arguments[0])
    return {"action": "store_true"} if annotation is bool else {"type": annotation}


if __name__ == "__main__":
    raise SystemExit(command.run(main))
