"""`export`: tracks and fits as csv, parquet, netCDF or figures, for other programs."""

import shutil
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import numpy as np

from galileo_jax.clip.checks import check_scale
from galileo_jax.clip.load import load_clip
from galileo_jax.clip.track_csv import read_observation_csv
from galileo_jax.files.tables import TABLE_FORMATS, write_table
from galileo_jax.inference.posterior import Posterior
from galileo_jax.measurement.measure import measure
from galileo_jax.observation.observation import Observation
from galileo_jax.report.draw import write_svgs
from galileo_jax.report.fit_page import charts_of_run
from galileo_jax.results.run import OBSERVATION, POSTERIOR, load_run, read_result
from galileo_jax.runtime.atomic_write import replacing, writing_into
from galileo_jax.runtime.errors import InputError
from galileo_jax.runtime.known_names import check_known
from galileo_jax.runtime.lazy import pd, xr
from galileo_jax.runtime.precision import in_float64

NETCDF, SVG = "netcdf", "svg"
FORMATS = (*TABLE_FORMATS, NETCDF, SVG)


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
    check_known("--to", "format", to, FORMATS)
    if not source.exists():
        raise InputError(f"{source}: no such file or folder")
    if source.is_dir():
        return Exported(tuple(_export_run(source, Path(out or source / "export"), to, fitted)))
    if to == SVG or fitted:
        option = f"--to {SVG}" if to == SVG else "--fitted"
        raise InputError(f"{option}: of a folder written by `galileo fit`, not of {source}")
    clip = load_clip(source)
    check_scale(clip)
    measured = measure(clip)
    folder, tracks = Path(out or f"{measured.name}_export"), {measured.name: measured.observation}
    if to == NETCDF:
        return Exported((_write_netcdf(folder / f"{measured.name}.nc", tracks),), clip.warnings)
    tables = {"track": _track_table(tracks, {})}
    return Exported(tuple(_write_tables(tables, folder, to)), clip.warnings)


def _export_run(folder: Path, out: Path, to: str, with_fitted: bool) -> Iterable[Path]:
    """Writes the tracks, the parameters' summaries and the draws of a run, or its figures."""
    result = read_result(folder)
    clips = {path.parent.name: path.parent for path in sorted(folder.glob(f"*/{OBSERVATION}"))}
    if (folder / OBSERVATION).is_file():
        clips = {Path(result["clips"][0]).stem: folder}
    if to == SVG:
        return _write_figures(clips, out)
    tracks = {name: read_observation_csv(one / OBSERVATION) for name, one in clips.items()}
    fitted = {name: _fitted_m(one) for name, one in clips.items()} if with_fitted else {}
    posterior = folder / POSTERIOR
    if not posterior.is_file():
        raise InputError(f"{posterior}: no such file; a folder written by `galileo fit` expected")
    if to == NETCDF:
        return [_write_netcdf(out / f"{folder.resolve().name}.nc", tracks, fitted, posterior)]
    tables = {
        "track": _track_table(tracks, fitted),
        "parameters": parameter_table(result),
        "draws": _draw_table(posterior),
    }
    return _write_tables(tables, out, to)


def _write_figures(clips: Mapping[str, Path], out: Path) -> Iterable[Path]:
    for name, folder in clips.items():
        run = load_run(folder)
        with writing_into(out):
            yield from write_svgs(out / name if len(clips) > 1 else out, charts_of_run(run))


def _write_tables(tables: Mapping[str, "pd.DataFrame"], out: Path, to: str) -> Iterable[Path]:
    for name, table in tables.items():
        path = out / f"{name}.{to}"
        with writing_into(out):
            write_table(path, table)
        yield path


def _write_netcdf(
    path: Path,
    tracks: Mapping[str, Observation],
    fitted_m: Mapping[str, np.ndarray] = {},
    posterior: Path | None = None,
) -> Path:
    """Writes ArviZ's `observed_data` of each clip, beside the groups of a posterior."""
    with writing_into(path.parent), replacing(path) as temporary:
        if posterior is not None:
            shutil.copyfile(posterior, temporary)
        for name, observation in tracks.items():
            _dataset(observation, fitted_m.get(name)).to_netcdf(
                temporary,
                mode="w" if posterior is None else "a",
                group="observed_data" if len(tracks) == 1 else f"observed_data/{name}",
                engine="h5netcdf",
            )
    return path


def _fitted_m(folder: Path) -> np.ndarray:
    """Where the best fit has the points that were followed: `[object, 2, frame]`, m."""
    run = load_run(folder)
    centres = np.asarray(run.problem.simulate(run.best[: len(run.problem.model.names)]))
    return centres + run.problem.observation.offset_m(centres)[..., None]


def _track_table(
    tracks: Mapping[str, Observation], fitted_m: Mapping[str, np.ndarray]
) -> "pd.DataFrame":
    """One row per clip, object and time; empty where the object was not visible."""
    parts = []
    for clip, observed in tracks.items():
        for k, name in enumerate(observed.names):
            sd = observed.sd_m[k]
            part = pd.DataFrame({"clip": clip, "object": name, "time_s": observed.times_s})
            known = len(part.columns)
            part["x_m"], part["y_m"], *z = observed.position_m[k]
            part["sd_x_m"], part["sd_y_m"] = sd[:2]
            part["correlation"] = observed.covariance_m2[k, 0, 1] / (sd[0] * sd[1])
            if z:
                part["z_m"], part["sd_z_m"] = z[0], sd[2]
            part.loc[~observed.mask[k], part.columns[known:]] = np.nan
            if clip in fitted_m:
                for axis, values in zip("xyz", fitted_m[clip][k], strict=False):
                    part[f"fitted_{axis}_m"] = values
            parts.append(part)
    return pd.concat(parts, ignore_index=True)


def parameter_table(result: Mapping[str, Any]) -> "pd.DataFrame":
    """One row per parameter, with the part of result.json in which it stands."""
    rows = [
        {"name": name, "kind": kind, **entry}
        for kind in ("parameters", "derived", "nuisances")
        for name, entry in result[kind].items()
    ]
    titles = ["name", "kind", "unit", "mean", "sd", "q025", "q975", "identified"]
    return pd.DataFrame(rows, columns=titles)


def _draw_table(posterior: Path) -> "pd.DataFrame":
    """One row per chain and draw, one column per parameter."""
    found = Posterior.from_netcdf(posterior)
    chain, draw = np.indices(found.draws.shape[:2]).reshape(2, -1)
    values = {name: found[name].reshape(-1) for name in found.names}
    log_density = found.log_density.reshape(-1)
    return pd.DataFrame({"chain": chain, "draw": draw, **values, "log_density": log_density})


def _dataset(observed: Observation, fitted_m: np.ndarray | None) -> Any:
    """ArviZ's `observed_data`: `position_m [object, axis, time]` and its covariance."""
    place = ("object", "axis", "time_s")
    data: dict[str, Any] = {
        "position_m": (place, observed.position_m),
        "covariance_m2": (("object", "axis", "other_axis", "time_s"), observed.covariance_m2),
        "is_seen": (("object", "time_s"), observed.mask.astype("i1")),
    }
    if fitted_m is not None:
        data["fitted_position_m"] = (place, fitted_m)
    axes = {"axis": ["x", "y"], "other_axis": ["x", "y"]}
    return xr.Dataset(data, {"object": list(observed.names), "time_s": observed.times_s, **axes})
