"""`galileo predict`: continue a fitted scene beyond its clip."""

from collections.abc import Sequence
from pathlib import Path

import galileo_jax as gx
from galileo_jax.commands import command
from galileo_jax.commands.options import VerbParser
from galileo_jax.runtime.atomic_write import check_folder
from galileo_jax.runtime.errors import InputError


def main(argv: Sequence[str]) -> None:
    """Writes prediction.json, its pictures and its part of the report into --out (default: RUN)."""
    asked = _parser().asked(argv)
    what = "--out" if "out" in asked else "RUN"
    out: Path = asked.pop("out", asked["fit"])
    if out.exists() and not out.is_dir():
        raise InputError(f"{what}: {out} is a file; a folder expected")
    check_folder(out)
    with command.progress_display() as display:
        ahead = gx.predict(**asked, on_progress=display)
        display("drawing", 1.0)
        written = ahead.save(out)
    print("\n".join(ahead.sentences))
    print(f"{out}/{', '.join(path.name for path in written)}")


def _parser() -> VerbParser:
    parser = VerbParser(
        "predict",
        "Predict how a fitted scene goes on after its clip, with 95 % intervals: do "
        "the objects move, how far, where do they stop, do they hit each other.",
        "galileo predict runs/clip --seconds 2",
        "galileo predict runs/clip --seconds 5 --draws 1000 --out ahead",
    )
    parser.add("fit", type=Path, metavar="RUN", help="the folder that fit wrote")
    parser.out("where to write (default: RUN)")
    parser.add("seconds", metavar="S")
    parser.add("seed", "draws")
    return parser
