"""`galileo scenarios`: the scenes that a clip can show, one line each."""

from collections.abc import Sequence

from galileo_jax.commands import command

EXAMPLES = """examples:
  galileo scenarios
  galileo scenarios | grep slope
"""


def main(argv: Sequence[str]) -> int | None:
    """Prints a line for each."""
    _parser().parse_args(argv)
    from galileo_jax.api.catalogue import scenarios

    known = scenarios()
    width = max(map(len, known.index))
    for name, meaning in known["meaning"].items():
        print(f"{name:<{width}}  {meaning}")
    return None


def _parser() -> command.Parser:
    return command.Parser(prog="galileo scenarios", description=__doc__, epilog=EXAMPLES)
