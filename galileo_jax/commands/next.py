"""`galileo next`: which setting of the lab would tell most?"""

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from galileo_jax.commands import command
from galileo_jax.commands.options import adder
from galileo_jax.commands.progress_display import progress_display
from galileo_jax.runtime.atomic_write import check_folder
from galileo_jax.runtime.errors import InputError

if TYPE_CHECKING:
    from galileo_jax.api.next_experiment import NextExperiment

NUM_SETTINGS = 8
LARGE = 1000.0
LEGEND = (
    "gain: expected gain in nats (0.69 nats decide between two equally probable hypotheses)",
    "named: probability that the true hypothesis is then named; lead: its mean lead in log odds",
    "hit: probability that object 1 reaches object 2",
)
NUMBERS = {"gain_nats": "gain nats", "named": "named", "lead_nats": "lead nats", "hit": "hit"}


def main(argv: Sequence[str]) -> int | None:
    """Says what every setting is expected to tell; writes next.json and a page."""
    call = _parser().parse_args(argv)
    runs = [Path(run) for run in call.found]
    out = Path(call.out) if call.out else runs[0]
    if out.exists() and not out.is_dir():
        raise InputError(f"{out}: a file; the folder of a run expected")
    check_folder(out)
    from galileo_jax.api.next_experiment import next_experiment

    with progress_display() as display:
        ahead = next_experiment(
            runs, can=call.can, about=call.about, seed=call.seed, on_progress=display
        )
        display("writing the page", 1.0)
        ahead.save(out)
    print("\n".join(_lines(ahead)))
    command.say(f"{out}/next.json, {out}/next.html")
    return None


def _lines(ahead: "NextExperiment") -> list[str]:
    """The hypotheses, the best settings, and what to do."""
    odds = ", ".join(f"{name} {p:.3f}" for name, p in ahead.hypotheses.items())
    rows = ahead.document["settings"][:NUM_SETTINGS]
    names = [name for name in rows[0] if name not in NUMBERS]
    lines = [f"still possible: {odds}", ""]
    lines.append("".join(f"{name:>10}" for name in (*names, *NUMBERS.values())))
    for row in rows:
        cells = [f"{row[name]:g}" for name in names]
        cells += ["-" if row[key] is None else _number(row[key]) for key in NUMBERS]
        lines.append("".join(f"{cell:>10}" for cell in cells))
    return [*lines, "", *LEGEND, "", ahead.sentence]


def _number(value: float) -> str:
    """With two places, or a whole one if it is large."""
    return f"{value:.2f}" if abs(value) < LARGE else f"{value:.0f}"


def _parser() -> command.Parser:
    parser = command.Parser(prog="galileo next", description=__doc__)
    parser.add_argument("found", nargs="+", metavar="RUN", help="folder that diagnose or fit wrote")
    add = adder(parser, "next_experiment")
    add("can", metavar="SETTINGS")
    add("about", metavar="PARAMETER")
    add("seed", type=command.whole_number(0))
    parser.add_argument("--out", metavar="DIR", help="where to write (default: the first RUN)")
    parser.examples(
        "galileo next runs/clip/diagnosis --can height=0.1:0.5,angle=10:30,fps=30|60|240",
        "galileo next runs/clip/diagnosis --can height=0.1:0.5,swap --about k2",
    )
    return parser
