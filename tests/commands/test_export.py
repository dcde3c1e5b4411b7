"""Export: what comes out of each format is what went in."""

import json
import sys
from pathlib import Path
from typing import Any, Literal

import numpy as np
import pandas as pd
import pytest
import xarray as xr

from galileo_jax.api.export import export
from galileo_jax.clip.track_csv import write_observation_csv
from galileo_jax.commands import command
from galileo_jax.commands import export as export_command
from galileo_jax.inference.posterior import Posterior, Status
from tests.clip.broken_clips import build_good_track
from tests.clip.test_track_csv import make_observation

NAMES = ("k1", "start_offset_object1")
ENTRY = {"mean": 0.2, "sd": 0.01, "q025": 0.18, "q975": 0.22, "unit": "1", "identified": True}
RESULT = {
    "clips": ["clips/slide.mp4"],
    "parameters": {"k1": ENTRY},
    "derived": {},
    "nuisances": {"start_offset_object1": {**ENTRY, "unit": "m", "mean": None}},
}


def make_run(folder: Path, clips: tuple[str, ...] = ("slide",)) -> Path:
    """A run's files, of one clip or several, without a fit."""
    folder.mkdir()
    draws = np.random.default_rng(1).normal(size=(2, 5, 2))
    Posterior(NAMES, draws, draws.sum(axis=2), Status.CONVERGED).to_netcdf(folder / "posterior.nc")
    content = RESULT | {"clips": [f"clips/{name}.mp4" for name in clips]}
    (folder / "result.json").write_text(json.dumps(content))
    for seed, name in enumerate(clips):
        one = folder if len(clips) == 1 else folder / name
        one.mkdir(exist_ok=True)
        write_observation_csv(one / "observation.csv", make_observation(seed, False))
    return folder


def run(*argv: object) -> int:
    return command.run(export_command.main, [str(part) for part in argv])


@pytest.mark.parametrize("to", ["csv", "parquet"])
def test_tables_of_a_run(to: str, tmp_path: Path, capsys) -> None:
    folder = make_run(tmp_path / "run")
    assert run(folder, "--to", to) == 0
    files = [folder / "export" / f"{name}.{to}" for name in ("track", "parameters", "draws")]
    assert capsys.readouterr().out.split() == [str(path) for path in files]
    tables: list[Any] = [
        pd.read_csv(path) if to == "csv" else pd.read_parquet(path) for path in files
    ]
    track, parameters, draws = tables

    seen = make_observation(0, False)
    assert list(track["object"].unique()) == list(seen.names)
    assert (track["clip"] == "slide").all()
    ball = track[track["object"] == "ball"]
    np.testing.assert_allclose(ball["time_s"], seen.times_s)
    np.testing.assert_allclose(ball["y_m"].to_numpy(float), seen.position_m[1, 1])
    np.testing.assert_allclose(ball["sd_x_m"].to_numpy(float) ** 2, seen.covariance_m2[1, 0, 0])
    assert ball["x_m"].isna().sum() == (~seen.mask[1]).sum() > 0

    assert list(parameters["name"]) == list(NAMES)
    assert list(parameters["kind"]) == ["parameters", "nuisances"]
    assert parameters["mean"][0] == 0.2
    assert np.isnan(parameters["mean"][1])
    assert bool(parameters["identified"][0]) is True

    kept = Posterior.from_netcdf(folder / "posterior.nc")
    assert list(draws.columns) == ["chain", "draw", *NAMES, "log_density"]
    np.testing.assert_allclose(draws["k1"], kept["k1"].reshape(-1))
    assert list(draws["chain"]) == [0] * 5 + [1] * 5


def test_netcdf_of_a_run(tmp_path: Path, capsys) -> None:
    folder = make_run(tmp_path / "run")
    assert run(folder, "--to", "netcdf", "--out", tmp_path / "out") == 0
    path = tmp_path / "out" / "run.nc"
    assert capsys.readouterr().out.strip() == str(path)
    kept = Posterior.from_netcdf(path)
    np.testing.assert_array_equal(kept.draws, Posterior.from_netcdf(folder / "posterior.nc").draws)
    with xr.open_dataset(path, group="observed_data", engine="h5netcdf") as data:
        assert data["position_m"].dims == ("object", "axis", "time_s")
        place = data["position_m"].sel(object="ball", axis="y")
        np.testing.assert_array_equal(place, make_observation(0, False).position_m[1, 1])


def test_several_clips(tmp_path: Path) -> None:
    folder = make_run(tmp_path / "run", ("first", "second"))
    export(folder, to="csv")
    track = pd.read_csv(folder / "export" / "track.csv")
    assert list(track["clip"].unique()) == ["first", "second"]
    (path,) = export(folder, to="netcdf").paths
    with xr.open_dataset(path, group="observed_data/second", engine="h5netcdf") as data:
        np.testing.assert_array_equal(data["position_m"], make_observation(1, False).position_m)


@pytest.mark.parametrize("to, name", [("parquet", "track.parquet"), ("netcdf", "clip.nc")])
def test_track_of_a_clip(to: Literal["parquet", "netcdf"], name: str, tmp_path: Path) -> None:
    path = build_good_track(tmp_path)
    export(path, to=to, out=tmp_path / "out")
    assert [found.name for found in (tmp_path / "out").iterdir()] == [name]


@pytest.mark.parametrize("argv, words", [
    (["none", "--to", "csv"], "none: no such file or folder"),
    (["empty", "--to", "csv"], "empty: no result.json"),
    (["run", "--to", "xlsx"], "--to: unknown format 'xlsx'; known: csv, parquet, netcdf, svg"),
    (["clips/clip.yaml", "--to", "svg"], "--to svg: of a folder written by `galileo fit`"),
    (["none", "--to", "svg"], "none: no such file or folder"),
    (["clips/clip.yaml", "--to", "csv", "--fitted"], "--fitted: of a folder written by"),
    (["run"], "--to"),
    (["run", "--to", "csv", "--out", "run/result.json"], "--out: run/result.json"),
    (["torn", "--to", "netcdf"], "torn/posterior.nc: no such file"),
])  # fmt: skip
def test_wrong_call_is_one_line(argv: list[str], words: str, tmp_path: Path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    make_run(tmp_path / "run")
    (tmp_path / "clips").mkdir()
    build_good_track(tmp_path / "clips")
    (tmp_path / "empty").mkdir()
    (make_run(tmp_path / "torn") / "posterior.nc").unlink()
    assert run(*argv) == 2
    line = capsys.readouterr().err
    assert words in line
    assert line.count("\n") == 1


def test_parquet_without_pyarrow_is_one_line(tmp_path: Path, capsys, monkeypatch) -> None:
    monkeypatch.setitem(sys.modules, "pyarrow", None)
    assert run(make_run(tmp_path / "run"), "--to", "parquet") == 2
    assert "pip install 'galileo-jax[parquet]'" in capsys.readouterr().err
