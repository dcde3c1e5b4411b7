"""`galileo next`: which setting of the lab would tell most?"""

from collections.abc import Sequence
from pathlib import Path

import galileo_jax as gx
from galileo_jax.commands import command
from galileo_jax.commands.options import VerbParser
from galileo_jax.experiment.settings import NUMBERS
from galileo_jax.runtime.atomic_write import check_folder
from galileo_jax.runtime.errors import InputError

NUM_SETTINGS = 8
LARGE = 1000.0
LEGEND = (
    "gain: expected gain in nats (0.69 nats decide between two equally probable hypotheses)",
    "named: probability that the true hypothesis is then named; lead: its mean lead in log odds",
    "hit: probability that object 1 reaches object 2",
)


def main(argv: Sequence[str]) -> None:
    """Says what every setting is expected to tell; writes next.json and a page."""
    asked = _parser().asked(argv)
    out: Path = asked.pop("out", asked["found"][0])
    if out.exists() and not out.is_dir():
        raise InputError(f"{out}: a file; the folder of a run expected")
    check_folder(out)
    with command.progress_display() as display:
        ahead = gx.next_experiment(**asked, on_progress=display)
        display("writing the page", 1.0)
        ahead.save(out)
    print("\n".join(_lines(ahead)))
    command.say(f"{out}/next.json, {out}/next.html")


def _lines(ahead: "gx.NextExperiment") -> list[str]:
    """The hypotheses, the best settings, and what to do."""
    odds = ", ".join(f"{name} {p:.3f}" for name, p in ahead.hypotheses.items())
    rows = ahead.document["settings"][:NUM_SETTINGS]
    names = [name for name in rows[0] if name not in NUMBERS]
    lines = [f"still possible: {odds}", ""]
    lines.append(
        "".join(f"{name:>10}" for name in (*names, *(n.replace("_", " ") for n in NUMBERS)))
    )
    for row in rows:
        cells = [f"{row[name]:g}" for name in names]
        cells += ["-" if row[key] is None else _number(row[key]) for key in NUMBERS]
        lines.append("".join(f"{cell:>10}" for cell in cells))
    return [*lines, "", *LEGEND, "", ahead.sentence]


def _number(value: float) -> str:
    """With two places, or a whole one if it is large."""
    return f"{value:.2f}" if abs(value) < LARGE else f"{value:.0f}"


def _parser() -> VerbParser:
    parser = VerbParser(
        "next",
        __doc__,
        "galileo next runs/clip/diagnosis --can height=0.1:0.5,angle=10:30,fps=30|60|240",
        "galileo next runs/clip/diagnosis --can height=0.1:0.5,swap --about k2",
        function="next_experiment",
    )
    wrote = "folder that diagnose or fit wrote"
    parser.add("found", type=Path, nargs="+", metavar="RUN", help=wrote)
    parser.add("can", metavar="SETTINGS")
    parser.add("about", metavar="PARAMETER")
    parser.add("seed")
    parser.out("where to write (default: the first RUN)")
    return parser
