"""`galileo scenarios`: the scenes that a clip can show, one line each."""

from collections.abc import Sequence

from galileo_jax.commands import command


def main(argv: Sequence[str]) -> int | None:
    """Prints a line for each."""
    _parser().parse_args(argv)
    from galileo_jax.api.catalogue import scenarios

    known = scenarios()
    print(command.in_columns(known["meaning"].to_dict()))
    return None


def _parser() -> command.Parser:
    parser = command.Parser(prog="galileo scenarios", description=__doc__)
    parser.examples(
        "galileo scenarios",
        "galileo scenarios | grep slope",
    )
    return parser
