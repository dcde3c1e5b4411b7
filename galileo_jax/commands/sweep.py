"""`galileo sweep`: many clips, many ways, from one config; stopped and taken up again at will."""

from collections import Counter
from collections.abc import Sequence
from typing import Any

from galileo_jax.commands import command
from galileo_jax.commands.progress_display import ProgressDisplay, progress_display

ENGINES = ("local", "ray")
MAX_LINES = 10  # failures that are printed one by one


def main(argv: Sequence[str]) -> int | None:
    """Computes what is missing of a sweep, and writes its tables and its page."""
    call = _parser().parse_args(argv)
    from galileo_jax.sweeping.sweep import sweep

    with progress_display() as display:
        found = sweep(**vars(call), on_progress=_FailurePrinter(display))
    count = Counter(row["status"] for row in found.summary)
    print(f"{count['done']} cells done, {count['failed']} failed")
    command.say(", ".join(map(str, [*found.tables, found.report_path])))
    return None


class _FailurePrinter:
    """Prints what is to be done and the first failures; shows progress otherwise."""

    def __init__(self, display: ProgressDisplay):
        self._display = display
        self._failures = 0

    def __call__(self, stage: str, share_done: float, partial: Any) -> None:
        self._display(stage, share_done)
        if not isinstance(partial, dict):
            return
        if "failed" in partial:
            self._failures += 1
            if self._failures <= MAX_LINES:
                command.say(f"failed: {partial['failed']}: {partial['why']}")
        else:
            command.say(
                f"{partial['cells']} cells, {partial['done']} of them done; {partial['folder']}"
            )


def _parser() -> command.Parser:
    parser = command.Parser(prog="galileo sweep", description=__doc__)
    parser.add_argument("config", metavar="CONFIG", help="a yaml file, or the name of a ready one")
    parser.add_argument(
        "--set",
        action="append",
        default=[],
        metavar="KEY=VALUE",
        help="another value in the config, such as common.seed=3 (may be given several times)",
    )
    parser.add_argument(
        "--multirun",
        action="append",
        default=[],
        metavar="KEY=A,B",
        help="the config once with each value (several times: all combinations)",
    )
    parser.add_argument(
        "--out", metavar="DIR", help="folder (default sweeps/CONFIG); what is done stays done"
    )
    parser.add_argument("--retry", action="store_true", help="try again what failed")
    group = parser.add_argument_group("where it is computed")
    group.add_argument(
        "--engine",
        choices=ENGINES,
        default="local",
        help="this machine, or a Ray cluster (default %(default)s)",
    )
    group.add_argument(
        "--address", metavar="HOST:PORT", help="of a Ray cluster (default: one on this machine)"
    )
    group.add_argument(
        "--workers",
        type=command.whole_number(0),
        metavar="N",
        help="processes of the local engine (default: as many as there is room for; 0: none, all "
        "is computed in the command's own process)",
    )
    group.add_argument(
        "--cpus-per-worker",
        type=command.whole_number(1),
        default=1,
        metavar="N",
        help="cores of each (default %(default)s)",
    )
    group.add_argument(
        "--gpus-per-worker",
        type=command.whole_number(0),
        default=0,
        metavar="N",
        help="GPUs of each (default %(default)s)",
    )
    parser.examples(
        "galileo sweep thesis_ablation                         a ready config",
        "galileo sweep class.yaml --set common.method=mh       your own, with another value",
    )
    return parser
