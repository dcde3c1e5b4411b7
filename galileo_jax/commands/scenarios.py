"""`galileo scenarios`: the scenes that a clip can show, one line each."""

from collections.abc import Sequence

import galileo_jax as gx
from galileo_jax.commands import command
from galileo_jax.commands.options import VerbParser


def main(argv: Sequence[str]) -> None:
    """Prints a line for each."""
    known = gx.scenarios(**_parser().asked(argv))
    print(command.in_columns(known["meaning"].to_dict()))


def _parser() -> VerbParser:
    examples = "galileo scenarios", "galileo scenarios | grep slope"
    return VerbParser("scenarios", __doc__, *examples)
