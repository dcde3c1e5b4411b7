"""`galileo predict`: continue a fitted scene beyond its clip."""

import argparse
import math
from collections.abc import Sequence
from pathlib import Path

from galileo_jax.commands import command
from galileo_jax.files.atomic_write import write_json, write_text
from galileo_jax.runtime.errors import InputError

NUM_DRAWS, MOST_DRAWS = 200, 10_000
LONGEST_S = 60.0


def main(argv: Sequence[str]) -> int | None:
    """Writes prediction.json, its pictures and its part of the report into --out (default: RUN)."""
    call = _parser().parse_args(argv)
    out: Path = call.out or call.run
    if out.exists() and not out.is_dir():
        what = "RUN" if call.out is None else "--out"
        raise InputError(f"{what}: {out} is a file; a folder expected")

    import jax

    jax.config.update("jax_enable_x64", True)
    from galileo_jax.prediction.extrapolate import answers, extrapolate
    from galileo_jax.report.draw import to_svg
    from galileo_jax.report.first_and_last import write_first_and_last
    from galileo_jax.report.prediction import prediction_lines, write_prediction
    from galileo_jax.report.prediction_chart import prediction_chart
    from galileo_jax.results.run import load_run

    with command.console().status("rolling out") as status:
        run = load_run(call.run)
        motions = extrapolate(run, call.seconds, call.draws, call.seed)
        found = answers(run, motions, call.seconds, call.seed)
        status.update("drawing")
        chart = prediction_chart(run, motions)
        try:
            write_first_and_last(run, motions, out / "first_and_last.png")
            write_text(out / "prediction.svg", to_svg(chart))
            page = write_prediction(out, run, found, chart)
            write_json(out / "prediction.json", found)
        except OSError as error:
            raise InputError(f"--out: {out}: {error.strerror or error}") from error
    print("\n".join(prediction_lines(run, found)))
    print(f"{out}/prediction.json, prediction.svg, first_and_last.png, {page.name}")
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
    add("--out", type=Path, metavar="DIR", help="default: RUN")
    add("--seed", type=command.whole_number(0), default=0)
    add(
        "--draws",
        type=command.whole_number(2, most=MOST_DRAWS),
        default=NUM_DRAWS,
        help=f"rollouts (default {NUM_DRAWS})",
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
