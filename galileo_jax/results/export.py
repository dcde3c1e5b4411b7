"""Tracks and fits as csv, parquet or netCDF, for other programs."""

import shutil
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from galileo_jax.clip.track_csv import read_observation_csv
from galileo_jax.files.tables import TABLE_FORMATS, write_table
from galileo_jax.inference.posterior import Posterior
from galileo_jax.observation.observation import Observation
from galileo_jax.results.run import OBSERVATION, POSTERIOR, load_run, read_result
from galileo_jax.runtime.atomic_write import replacing, writing_into
from galileo_jax.runtime.errors import InputError

if TYPE_CHECKING:
    import pandas as pd

FORMATS = (*TABLE_FORMATS, "netcdf")
TRACK, PARAMETERS, DRAWS = "track", "parameters", "draws"
AXES = ("x", "y")
MEASURED = ("x_m", "y_m", "sd_x_m", "sd_y_m", "correlation")


def export_run(folder: Path, out: Path, to: str, with_fitted: bool) -> list[Path]:
    """Writes the tracks, the parameters' summaries and the draws of a run.

    Returns:
      the files.

    Raises:
      InputError: it is no finished run, or a file cannot be written.
    """
    result = read_result(folder)
    folders = clip_folders(folder, result)
    tracks = {name: read_observation_csv(one / OBSERVATION) for name, one in folders.items()}
    fitted = {name: _fitted_m(one) for name, one in folders.items()} if with_fitted else {}
    posterior = folder / POSTERIOR
    if not posterior.is_file():
        raise InputError(f"{posterior}: no such file; a folder written by `galileo fit` expected")
    if to == "netcdf":
        path = out / f"{folder.resolve().name}.nc"
        with writing_into(out), replacing(path) as temporary:
            shutil.copyfile(posterior, temporary)
            for name, observation in tracks.items():
                group = "observed_data" if len(tracks) == 1 else f"observed_data/{name}"
                _dataset(observation, fitted.get(name)).to_netcdf(
                    temporary, mode="a", group=group, engine="h5netcdf"
                )
        return [path]
    tables = {
        TRACK: _track_table(tracks, fitted),
        PARAMETERS: parameter_table(result),
        DRAWS: _draw_table(posterior),
    }
    return _write(tables, out, to)


def export_tracks(tracks: Mapping[str, Observation], out: Path, to: str) -> list[Path]:
    """Writes tracks by the names of their clips; see `export_run`."""
    if to != "netcdf":
        return _write({TRACK: _track_table(tracks, {})}, out, to)
    written = []
    for name, observation in tracks.items():
        path = out / f"{name}.nc"
        with writing_into(out), replacing(path) as temporary:
            _dataset(observation, None).to_netcdf(
                temporary, mode="w", group="observed_data", engine="h5netcdf"
            )
        written.append(path)
    return written


def _write(tables: Mapping[str, "pd.DataFrame"], out: Path, to: str) -> list[Path]:
    written = []
    for name, table in tables.items():
        path = out / f"{name}.{to}"
        with writing_into(out):
            write_table(path, table)
        written.append(path)
    return written


def clip_folders(folder: Path, result: dict[str, Any]) -> dict[str, Path]:
    """Name and folder of every clip of a run; of several clips each has a folder of its own."""
    if (folder / OBSERVATION).is_file():
        return {Path(result["clips"][0]).stem: folder}
    return {path.parent.name: path.parent for path in sorted(folder.glob(f"*/{OBSERVATION}"))}


def _fitted_m(folder: Path) -> np.ndarray:
    """Where the best fit has the points that were followed: `[object, 2, frame]`, m."""
    run = load_run(folder)
    centres = np.asarray(run.problem.simulate(run.best[: len(run.problem.model.names)]))
    return centres + run.problem.observation.offset_m(centres)[..., None]


def _track_table(
    tracks: Mapping[str, Observation], fitted_m: Mapping[str, np.ndarray]
) -> "pd.DataFrame":
    """One row per clip, object and time; empty where the object was not visible."""
    import pandas as pd

    parts = []
    for clip, observed in tracks.items():
        for k, name in enumerate(observed.names):
            covariance = observed.covariance_m2[k]
            sd_x, sd_y = np.sqrt(covariance[0, 0]), np.sqrt(covariance[1, 1])
            part = pd.DataFrame({"clip": clip, "object": name, "time_s": observed.times_s})
            part["x_m"], part["y_m"], *z = observed.position_m[k]
            part["sd_x_m"], part["sd_y_m"] = sd_x, sd_y
            part["correlation"] = covariance[0, 1] / (sd_x * sd_y)
            if z:
                part["z_m"], part["sd_z_m"] = z[0], np.sqrt(covariance[2, 2])
            measured = [*MEASURED, *(("z_m", "sd_z_m") if z else ())]
            part.loc[~observed.mask[k], measured] = np.nan
            if clip in fitted_m:
                for axis, values in zip("xyz", fitted_m[clip][k], strict=False):
                    part[f"fitted_{axis}_m"] = values
            parts.append(part)
    return pd.concat(parts, ignore_index=True)


def parameter_table(result: Mapping[str, Any]) -> "pd.DataFrame":
    """One row per parameter, with the part of result.json in which it stands."""
    import pandas as pd

    rows = [
        {"name": name, "kind": kind, **entry}
        for kind in ("parameters", "derived", "nuisances")
        for name, entry in result[kind].items()
    ]
    titles = ["name", "kind", "unit", "mean", "sd", "q025", "q975", "identified"]
    return pd.DataFrame(rows, columns=titles)


def _draw_table(posterior: Path) -> "pd.DataFrame":
    """One row per chain and draw, one column per parameter."""
    import pandas as pd

    found = Posterior.from_netcdf(posterior)
    chains, draws = found.draws.shape[:2]
    return pd.DataFrame(
        {
            "chain": np.repeat(np.arange(chains), draws),
            "draw": np.tile(np.arange(draws), chains),
            **{name: found[name].reshape(-1) for name in found.names},
            "log_density": found.log_density.reshape(-1),
        }
    )


def _dataset(observed: Observation, fitted_m: np.ndarray | None) -> Any:
    """ArviZ's `observed_data`: `position_m [object, axis, time]` and its covariance."""
    import xarray as xr

    place = ("object", "axis", "time_s")
    data: dict[str, Any] = {
        "position_m": (place, observed.position_m),
        "covariance_m2": (("object", "axis", "other_axis", "time_s"), observed.covariance_m2),
        "is_seen": (("object", "time_s"), observed.mask.astype("i1")),
    }
    if fitted_m is not None:
        data["fitted_position_m"] = (place, fitted_m)
    axes = {"axis": list(AXES), "other_axis": list(AXES)}
    return xr.Dataset(data, {"object": list(observed.names), "time_s": observed.times_s, **axes})
