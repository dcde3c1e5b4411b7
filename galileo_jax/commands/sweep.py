"""`galileo sweep`: evaluate many clips, with several methods; can be stopped and resumed."""

import itertools
from collections import Counter
from collections.abc import Mapping, Sequence
from typing import Any

from galileo_jax.commands import command
from galileo_jax.commands.options import adder
from galileo_jax.commands.progress_display import progress_display

MAX_LINES = 10  # failures that are printed one by one


def main(argv: Sequence[str]) -> int | None:
    """Computes what is missing of a sweep, and writes its tables and its page."""
    call = _parser().parse_args(argv)
    from galileo_jax.sweeping.sweep import sweep

    with progress_display() as display:
        failures = itertools.count(1)

        def show(partial: Mapping[str, Any]) -> None:
            if "failed" not in partial:
                cells = f"{partial['cells']} cells, {partial['done']} of them done"
                command.say(f"{cells}; {partial['folder']}")
            elif next(failures) <= MAX_LINES:
                command.say(f"failed: {partial['failed']}: {partial['why']}")

        found = sweep(**vars(call), on_progress=display.showing(show))
    for one in found.agreements:
        print(one.sentence)
    for row in found.summary:
        if row["remark"]:
            command.say(f"{row['clips']}: {row['remark']}")
    count = Counter(row["status"] for row in found.summary)
    print(f"{count['done']} cells done, {count['failed']} failed")
    command.say(", ".join(map(str, [*found.tables, found.report_path])))
    return None


def _parser() -> command.Parser:
    parser = command.Parser(prog="galileo sweep", description=__doc__)
    parser.add_argument(
        "config",
        metavar="CONFIG",
        help="a yaml file, the name of a ready one, or a folder of films and tables: each alone",
    )
    add = adder(parser, "sweep")
    add("set", "multirun", metavar="KEY=VALUE")
    add("out", metavar="DIR")
    add("retry")
    add = adder(parser.add_argument_group("where it is computed"), "sweep")
    add("engine")
    add("address", metavar="HOST:PORT")
    add("workers", "cpus_per_worker", "gpus_per_worker", "together")
    parser.examples(
        "galileo sweep films/                                  a class: a film of each group",
        "galileo sweep thesis_ablation                         a ready config",
        "galileo sweep class.yaml --set common.method=mh       your own, with another value",
    )
    return parser
