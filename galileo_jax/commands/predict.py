"""`galileo predict`: continue a fitted scene beyond its clip."""

import argparse
import math
from collections.abc import Sequence
from pathlib import Path

from galileo_jax.commands import command
from galileo_jax.commands.progress_display import progress_display
from galileo_jax.runtime.errors import InputError

NUM_DRAWS, MOST_DRAWS = 200, 10_000  # as api.predict has them, which imports JAX
LONGEST_S = 60.0


def main(argv: Sequence[str]) -> int | None:
    """Writes prediction.json, its pictures and its part of the report into --out (default: RUN)."""
    call = _parser().parse_args(argv)
    out: Path = call.out or call.run
    if out.exists() and not out.is_dir():
        what = "RUN" if call.out is None else "--out"
        raise InputError(f"{what}: {out} is a file; a folder expected")
    from galileo_jax.api.predict import predict

    with progress_display() as display:
        ahead = predict(
            call.run, seconds=call.seconds, draws=call.draws, seed=call.seed, on_progress=display
        )
        display("drawing", 1.0)
        written = ahead.save(out)
    print("\n".join(ahead.sentences))
    print(f"{out}/{', '.join(path.name for path in written)}")
    return None


def _parser() -> command.Parser:
    parser = command.Parser(
        prog="galileo predict",
        description="Continue a fitted scene beyond its clip, with 95 % intervals from the "
        "posterior: will it move, how far, where does it stop, does it hit.",
    )
    add = parser.add_argument
    add("run", type=Path, metavar="RUN", help="the folder that fit wrote")
    add("--seconds", type=_seconds, required=True, metavar="S", help="how long beyond the clip")
    add("--out", type=Path, metavar="DIR", help="where to write (default: RUN)")
    add("--seed", type=command.whole_number(0), default=0, help="of the draws (default 0)")
    add(
        "--draws",
        type=command.whole_number(2, most=MOST_DRAWS),
        default=NUM_DRAWS,
        help="how many rollouts of posterior draws (default %(default)s)",
    )
    parser.examples(
        "galileo predict runs/clip --seconds 2",
        "galileo predict runs/clip --seconds 5 --draws 1000 --out ahead",
    )
    return parser


def _seconds(text: str) -> float:
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not 0 < value <= LONGEST_S:
        raise argparse.ArgumentTypeError(f"{text!r} is no time; seconds in (0, {LONGEST_S:g}]")
    return value
