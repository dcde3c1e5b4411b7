"""`galileo look`: what is understood of a table or film, before anything is declared."""

from collections.abc import Sequence
from pathlib import Path

import galileo_jax as gx
from galileo_jax.commands.clip_options import warn
from galileo_jax.commands.options import VerbParser


def main(argv: Sequence[str]) -> None:
    """Prints the columns, the time, what moves, the likely scenario and a yaml."""
    asked = _parser().asked(argv)
    picture = asked.pop("plot", None)
    found = gx.look(**asked)
    print(found.summary())
    warn(found.warnings)
    if picture is not None:
        print(found.plot(picture))


def _parser() -> VerbParser:
    parser = VerbParser(
        "look",
        "Show what is understood of a table or film: columns with roles and units,\n"
        "time step, gaps, what moves, the likely scenario, and the yaml to begin with.",
        "galileo look drop.csv",
        "galileo look points.txt --fps 240 --plot points.png",
    )
    parser.add("file", metavar="FILE", help="a table of any program, or a film")
    parser.add("fps", help="where the table counts frames (default: not known)")
    parser.add_argument(
        "--plot",
        type=Path,
        metavar="PNG",
        help="write the places in time, or of a film what moves (default: no figure)",
    )
    return parser
