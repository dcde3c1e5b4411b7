"""`galileo effects`: the effects that a model can have, one line each."""

from collections.abc import Sequence

from galileo_jax.commands import command
from galileo_jax.commands.options import adder


def main(argv: Sequence[str]) -> int | None:
    """Prints a line for each."""
    call = _parser().parse_args(argv)
    from galileo_jax.api.catalogue import effects

    known = effects(call.effects_from)
    print(command.in_columns(known["meaning"].to_dict()))
    return None


def _parser() -> command.Parser:
    parser = command.Parser(prog="galileo effects", description=__doc__)
    adder(parser, "effects")("effects_from", metavar="FILE.py")
    parser.examples(
        "galileo effects",
        "galileo effects --effects-from my_effect.py",
    )
    return parser
