"""`galileo predict`: continue a fitted scene beyond its clip."""

from collections.abc import Sequence
from pathlib import Path

from galileo_jax.commands import command
from galileo_jax.commands.options import adder
from galileo_jax.commands.progress_display import progress_display
from galileo_jax.runtime.atomic_write import check_folder
from galileo_jax.runtime.errors import InputError


def main(argv: Sequence[str]) -> int | None:
    """Writes prediction.json, its pictures and its part of the report into --out (default: RUN)."""
    call = _parser().parse_args(argv)
    out: Path = call.out or call.run
    if out.exists() and not out.is_dir():
        what = "RUN" if call.out is None else "--out"
        raise InputError(f"{what}: {out} is a file; a folder expected")
    check_folder(out)
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
        description="Predict how a fitted scene goes on after its clip, with 95 % intervals: do "
        "the objects move, how far, where do they stop, do they hit each other.",
    )
    parser.add_argument("run", type=Path, metavar="RUN", help="the folder that fit wrote")
    parser.add_argument("--out", type=Path, metavar="DIR", help="where to write (default: RUN)")
    add = adder(parser, "predict")
    add("seconds", metavar="S")
    add("seed", type=command.whole_number(0))
    add("draws")
    parser.examples(
        "galileo predict runs/clip --seconds 2",
        "galileo predict runs/clip --seconds 5 --draws 1000 --out ahead",
    )
    return parser
