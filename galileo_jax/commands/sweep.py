"""`galileo sweep`: evaluate many clips, with several methods; can be stopped and resumed."""

import itertools
from collections import Counter
from collections.abc import Mapping, Sequence
from typing import Any

import galileo_jax as gx
from galileo_jax.commands import command
from galileo_jax.commands.options import VerbParser

MAX_LINES = 10  # failures that are printed one by one


def main(argv: Sequence[str]) -> None:
    """Computes what is missing of a sweep, and writes its tables and its page."""
    asked = _parser().asked(argv)
    with command.progress_display() as display:
        failures = itertools.count(1)

        def show(partial: Mapping[str, Any]) -> None:
            if "failed" not in partial:
                cells = f"{partial['cells']} cells, {partial['done']} of them done"
                command.say(f"{cells}; {partial['folder']}")
            elif next(failures) <= MAX_LINES:
                command.say(f"failed: {partial['failed']}: {partial['why']}")

        found = gx.sweep(**asked, on_progress=display.showing(show))
    for one in found.agreements:
        print(one.sentence)
    for row in found.summary:
        if row["remark"]:
            command.say(f"{row['clips']}: {row['remark']}")
    count = Counter(row["status"] for row in found.summary)
    print(f"{count['done']} cells done, {count['failed']} failed")
    command.say(", ".join(map(str, [*found.tables, found.report_path])))


def _parser() -> VerbParser:
    parser = VerbParser(
        "sweep",
        __doc__,
        "galileo sweep films/                                  a class: a film of each group",
        "galileo sweep thesis_ablation                         a ready config",
        "galileo sweep class.yaml --set common.method=mh       your own, with another value",
    )
    what = "a yaml file, the name of a ready one, or a folder of films and tables: each alone"
    parser.add("config", metavar="CONFIG", help=what)
    parser.add("set", "multirun", metavar="KEY=VALUE")
    parser.add("out", metavar="DIR")
    parser.add("retry")
    add = parser.group("where it is computed")
    add("engine", choices=("local", "ray"))
    add("address", metavar="HOST:PORT")
    add("workers", "cpus_per_worker", "gpus_per_worker", "together")
    return parser
