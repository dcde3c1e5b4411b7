"""`galileo look`: what is understood of a table or film, before anything is declared."""

from collections.abc import Sequence
from pathlib import Path

from galileo_jax.commands import command
from galileo_jax.commands.clip_options import warn


def main(argv: Sequence[str]) -> int | None:
    """Prints the columns, the time, what moves, the likely scenario and a yaml."""
    asked = _parser().parse_args(argv)
    from galileo_jax.api.look import look

    found = look(asked.file, fps=asked.fps)
    print(found.summary())
    warn(found.warnings)
    if asked.plot is not None:
        print(found.plot(asked.plot))
    return None


def _parser() -> command.Parser:
    parser = command.Parser(
        prog="galileo look",
        description="Show what is understood of a table or film: columns with roles and units,\n"
        "time step, gaps, what moves, the likely scenario, and the yaml to begin with.",
    )
    parser.examples("galileo look drop.csv", "galileo look points.txt --fps 240 --plot points.png")
    parser.add_argument("file", type=Path, metavar="FILE", help="a table of any program, or a film")
    parser.add_argument(
        "--fps", type=float, metavar="HZ", help="where the table counts frames (default: not known)"
    )
    parser.add_argument(
        "--plot",
        type=Path,
        metavar="PNG",
        help="write the places in time, or of a film what moves (default: no figure)",
    )
    return parser
