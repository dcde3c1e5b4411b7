"""`galileo discover`: a lab and a loop: measure, diagnose, choose the next setting."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import galileo_jax as gx
from galileo_jax.commands import command
from galileo_jax.commands.options import VerbParser, whole_number
from galileo_jax.experiment.settings import text_of


def main(argv: Sequence[str]) -> None:
    """Runs the loop; prints every experiment and every verdict when it is there."""
    asked = _parser().asked(argv)
    out = asked.setdefault("out", Path("runs") / (Path(asked["lab"]).stem or "lab"))
    with command.progress_display() as display:

        def show(partial: Mapping[str, Any]) -> None:
            if "experiment" in partial:
                display.print(_experiment(partial["experiment"]))
            elif "clips" in partial.get("round", {}):
                display.print(f"  {partial['round']['sentence']}")

        found = gx.discover(**asked, on_progress=display.showing(show))
    print(found.sentence)
    print(f"It ended because {found.document['ended']}.")
    command.say(f"{out}/discover.json, {out}/report.html")


def _experiment(row: Mapping[str, Any]) -> str:
    became = "" if row["outcome"] == "track" else f"\n  lost: {row['line']}"
    return f"experiment {row['number']}: {text_of(row['settings'])}\n  why: {row['reason']}{became}"


def _parser() -> VerbParser:
    parser = VerbParser(
        "discover",
        __doc__,
        "galileo discover examples/lab.py                      until the verdict is settled",
        "galileo discover ./my_lab --budget 8 --out runs/lab   again: continues where it was",
    )
    parser.add("lab", metavar="LAB", help="a program; protocol: docs/how-to/discover.md")
    parser.add("budget", type=whole_number(1))
    kept = "with the same folder, an interrupted discovery continues"
    parser.out(f"folder (default runs/LAB); {kept}")
    parser.add("timeout", metavar="S")
    parser.add("effects_from", "seed")
    return parser
