"""The runner: `python -m benchmarks NAME [arguments]`; without a name, a line about each.

A benchmark is a module here with `options(parser)`, which declares its arguments, and `main(call)`,
which prints a table and returns the figures of the last line, one of JSON.
"""

import argparse
import ast
import importlib
from collections.abc import Sequence
from pathlib import Path

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
    module = importlib.import_module(f"benchmarks.{name}")
    parser = command.Parser(
        prog=f"python -m benchmarks {name}",
        description=module.__doc__,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    module.options(parser)
    figures = module.main(parser.parse_args(arguments))
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


if __name__ == "__main__":
    raise SystemExit(command.run(main))
