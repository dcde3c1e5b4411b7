"""`galileo discover`: a lab and a loop: measure, diagnose, choose the next setting."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from galileo_jax.commands import command
from galileo_jax.commands.options import adder
from galileo_jax.commands.progress_display import progress_display
from galileo_jax.experiment.settings import text_of


def main(argv: Sequence[str]) -> int | None:
    """Runs the loop; prints every experiment and every verdict when it is there."""
    asked = vars(_parser().parse_args(argv))
    out = Path(asked.pop("out") or Path("runs") / (Path(asked["lab"]).stem or "lab"))
    from galileo_jax.api.discover import discover

    with progress_display() as display:

        def show(partial: Mapping[str, Any]) -> None:
            if "experiment" in partial:
                display.print(_experiment(partial["experiment"]))
            elif "clips" in partial.get("round", {}):
                display.print(f"  {partial['round']['sentence']}")

        found = discover(**asked, out=out, on_progress=display.showing(show))
    print(found.sentence)
    print(f"It ended because {found.document['ended']}.")
    command.say(f"{out}/discover.json, {out}/report.html")
    return None


def _experiment(row: Mapping[str, Any]) -> str:
    became = "" if row["outcome"] == "track" else f"\n  lost: {row['line']}"
    return f"experiment {row['number']}: {text_of(row['settings'])}\n  why: {row['reason']}{became}"


def _parser() -> command.Parser:
    parser = command.Parser(prog="galileo discover", description=__doc__)
    parser.add_argument("lab", metavar="LAB", help="a program; protocol: docs/how-to/discover.md")
    add = adder(parser, "discover")
    add("budget", type=command.whole_number(1))
    parser.add_argument("--out", metavar="DIR", help="folder (default runs/LAB); with the same "
    "folder, an interrupted discovery continues")  # fmt: skip
    add("timeout", metavar="S")
    add("effects_from", metavar="FILE.py")
    add("seed", type=command.whole_number(0))
    parser.examples(
        "galileo discover examples/lab.py                      until the verdict is settled",
        "galileo discover ./my_lab --budget 8 --out runs/lab   again: continues where it was",
    )
    return parser
