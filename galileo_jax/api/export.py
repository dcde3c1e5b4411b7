"""`export`: tracks and fits, for other programs."""

from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from galileo_jax.clip.checks import check_scale
from galileo_jax.clip.load import load_clip
from galileo_jax.measurement.measure import measure
from galileo_jax.results.export import (
    FORMATS,
    clip_folders,
    export_run,
    export_tracks,
)
from galileo_jax.results.run import load_run, read_result
from galileo_jax.runtime.atomic_write import writing_into
from galileo_jax.runtime.errors import InputError
from galileo_jax.runtime.known_names import check_known
from galileo_jax.runtime.precision import in_float64

SVG = "svg"


@dataclass(frozen=True)
class Exported:
    """What `export` wrote."""

    paths: tuple[Path, ...]
    warnings: tuple[str, ...] = ()


@in_float64
def export(
    source: str | Path,
    *,
    to: Literal["csv", "parquet", "netcdf", "svg"],
    fitted: bool = False,
    out: str | Path | None = None,
) -> Exported:
    """Writes the track of a clip, or tracks, parameters and draws of a run.

    csv and parquet are the tables track, parameters and draws; netCDF is one file that ArviZ and
    xarray read; svg are the figures of a fit's page, one file each. Lengths in m, times in s.

    Args:
      source: the folder that a fit was saved to, or a clip.
      to: "csv", "parquet", "netcdf" or, of a run, "svg".
      fitted: of a run: also where the fitted model has the objects, at the posterior's mean.
      out: folder; None: RUN/export, or CLIP_export.

    Raises:
      InputError: there is no such clip or run, or a file cannot be written.

    Examples:
      >>> import galileo_jax as gx
      >>> made = gx.simulate("slide.csv", scenario="incline", seed=1, track_only=True)
      >>> [path.name for path in gx.export("slide.csv", to="csv", out="tables").paths]
      ['track.csv']
    """
    source = Path(source)
    check_known("--to", "format", to, (*FORMATS, SVG))
    if not source.exists():
        raise InputError(f"{source}: no such file or folder")
    if to == SVG:
        return Exported(tuple(_plots(source, Path(out or source / "export"))))
    if source.is_dir():
        return Exported(tuple(export_run(source, Path(out or source / "export"), to, fitted)))
    if fitted:
        raise InputError(f"--fitted: of a folder written by `galileo fit`, not of {source}")
    clip = load_clip(source)
    check_scale(clip)
    measured = measure(clip)
    folder = Path(out or f"{measured.name}_export")
    paths = export_tracks({measured.name: measured.observation}, folder, to)
    return Exported(tuple(paths), clip.warnings)


def _plots(folder: Path, out: Path) -> list[Path]:
    from galileo_jax.report.draw import write_svgs
    from galileo_jax.report.fit_page import charts_of_run

    if not folder.is_dir():
        raise InputError(f"--to {SVG}: of a folder written by `galileo fit`, not of {folder}")
    folders = clip_folders(folder, read_result(folder))
    written = []
    for name, one in folders.items():
        run = load_run(one)
        with writing_into(out):
            written += write_svgs(out / name if len(folders) > 1 else out, charts_of_run(run))
    return written
