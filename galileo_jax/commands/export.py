"""`galileo export`: tracks and fits as csv, parquet or netCDF, for other programs."""

from collections.abc import Sequence
from pathlib import Path

from galileo_jax.api.export import export
from galileo_jax.commands import command
from galileo_jax.results.export import FORMATS


def main(argv: Sequence[str]) -> int | None:
    """Writes what a run, or a clip's track, holds; prints the files."""
    done = export(**vars(_parser().parse_args(argv)))
    for warning in done.warnings:
        command.console().print(f"warning: {warning}", soft_wrap=True, markup=False)
    print("\n".join(map(str, done.paths)))
    return None


def _parser() -> command.Parser:
    parser = command.Parser(
        prog="galileo export",
        description="Tracks and fits for other programs: csv and parquet as the tables track,\n"
        "parameters and draws; netCDF as one file that ArviZ and xarray read.",
    )
    parser.examples(
        "galileo export runs/clip --to netcdf",
        "galileo export clip.mp4 --to csv --out tables",
    )
    add = parser.add_argument
    add("source", type=Path, metavar="RUN|CLIP", help="the folder that fit wrote, or a clip")
    add(
        "--to",
        required=True,
        metavar="FORMAT",
        help=f"{', '.join(FORMATS)} (no default)",
    )
    add(
        "--fitted",
        action="store_true",
        help="of a run: also where the fitted model has the objects, at the posterior's mean "
        "(default: off)",
    )
    add("--out", type=Path, metavar="DIR", help="default: RUN/export, or CLIP_export")
    return parser
