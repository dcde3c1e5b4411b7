"""`galileo export`: tracks and fits as csv, parquet or netCDF, for other programs."""

from collections.abc import Sequence

from galileo_jax.api.export import export
from galileo_jax.commands import command
from galileo_jax.commands.clip_options import warn
from galileo_jax.commands.options import adder


def main(argv: Sequence[str]) -> int | None:
    """Writes what a run, or a clip's track, holds; prints the files."""
    done = export(**vars(_parser().parse_args(argv)))
    warn(done.warnings)
    print("\n".join(map(str, done.paths)))
    return None


def _parser() -> command.Parser:
    parser = command.Parser(
        prog="galileo export",
        description="Tracks and fits for other programs: csv and parquet as the tables track,\n"
        "parameters and draws; netCDF as one file that ArviZ and xarray read; figures as svg.",
    )
    parser.examples(
        "galileo export runs/clip --to netcdf",
        "galileo export runs/clip --to svg --out figures",
    )
    parser.add_argument("source", metavar="RUN|CLIP", help="the folder that fit wrote, or a clip")
    add = adder(parser, "export")
    add("to", choices=None, metavar="FORMAT")
    add("fitted")
    add("out", metavar="DIR")
    return parser
