"""`galileo export`: tracks and fits as csv, parquet or netCDF, for other programs."""

from collections.abc import Sequence

import galileo_jax as gx
from galileo_jax.commands.clip_options import warn
from galileo_jax.commands.options import VerbParser


def main(argv: Sequence[str]) -> None:
    """Writes what a run, or a clip's track, holds; prints the files."""
    done = gx.export(**_parser().asked(argv))
    warn(done.warnings)
    print("\n".join(map(str, done.paths)))


def _parser() -> VerbParser:
    parser = VerbParser(
        "export",
        "Tracks and fits for other programs: csv and parquet as the tables track,\n"
        "parameters and draws; netCDF as one file that ArviZ and xarray read; figures as svg.",
        "galileo export runs/clip --to netcdf",
        "galileo export runs/clip --to svg --out figures",
    )
    parser.add("source", metavar="RUN|CLIP", help="the folder that fit wrote, or a clip")
    parser.add("to", choices=None, metavar="FORMAT")
    parser.add("fitted")
    parser.add("out", metavar="DIR")
    return parser
