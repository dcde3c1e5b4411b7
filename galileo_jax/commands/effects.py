"""`galileo effects`: the effects that a model can have, one line each."""

from collections.abc import Sequence

import galileo_jax as gx
from galileo_jax.commands import command
from galileo_jax.commands.options import VerbParser


def main(argv: Sequence[str]) -> None:
    """Prints a line for each."""
    known = gx.effects(**_parser().asked(argv))
    print(command.in_columns(known["meaning"].to_dict()))


def _parser() -> VerbParser:
    parser = VerbParser(
        "effects", __doc__, "galileo effects", "galileo effects --effects-from my_effect.py"
    )
    parser.add("effects_from", option="--effects-from")
    return parser
