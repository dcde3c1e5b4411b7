"""`galileo fit`, end to end: truths come back, wrong calls are one line, same seed same file."""

import json
import math
import subprocess
import sys
from dataclasses import replace
from importlib import import_module
from typing import Any

import numpy as np
import pytest
import yaml

from galileo_jax.api import fit_result
from galileo_jax.api.fit import OFF_THE_PLANE, fit
from galileo_jax.api.simulate import simulate
from galileo_jax.clip.track_csv import write_observation_csv
from galileo_jax.commands import command
from galileo_jax.commands import fit as fit_command
from galileo_jax.commands.command import ProgressDisplay
from galileo_jax.inference.samplers import driver
from galileo_jax.observation.observation import Observation
from galileo_jax.results.run import load_run
from tests.clip.broken_clips import build_good_track
from tests.precision import in_64_bit
from tests.ramp_model import HIT
from tests.reference_ramp import solve

NOISE_M = 2e-4
SIGMAS = 4.0  # a truth further off than so many of the stated standard deviations is a failure
K1_ATOL = 0.01  # the bar for the worst clip
# Of means and standard deviations by MuJoCo's contacts, which give way; a third, 3 % measured.
ENGINES_SIGMAS, ENGINES_SD_RTOL = 1.0, 0.15
CHI2_RANGE = (0.6, 1.6)  # a hundred values and the project's own bar of 0.7 to 1.5
ENTRY = {"mean", "sd", "q025", "q975", "unit", "identified"}


@pytest.fixture(autouse=True)
def precision():
    """The command switches JAX to 64 bit for its process; not for the other tests."""
    with in_64_bit():
        yield


@pytest.fixture(autouse=True)
def without_pages(monkeypatch):
    """Pages have tests of their own; only the fit shared by the module writes one."""
    monkeypatch.setattr(fit_result, "write_report", lambda *_: None)


def write_clip(folder, centres, times, scenario="ramp", **keys):
    """A csv track with noise, and its yaml; returns the yaml."""
    folder.mkdir(parents=True, exist_ok=True)
    rng = np.random.default_rng(5)
    count, _, frames = centres.shape
    names = ("object1", "object2")[:count]
    covariance = np.broadcast_to(NOISE_M**2 * np.eye(2)[None, ..., None], (count, 2, 2, frames))
    noisy = centres + NOISE_M * rng.standard_normal(centres.shape)
    seen = Observation(names, times, noisy, covariance, np.ones((count, frames), bool))
    write_observation_csv(folder / "clip.csv", seen)
    objects = [{"name": n, "shape": "box", "size_m": [0.06, 0.06, 0.06]} for n in names]
    content = {"track": "clip.csv", "scenario": scenario, "fps": 1 / float(times[1]), **keys}
    content.setdefault("ramp_angle_deg", math.degrees(HIT.angle_rad))
    (folder / "clip.yaml").write_text(yaml.safe_dump({**content, "objects": objects}))
    return folder / "clip.yaml"


def call_fit(clip, out, *more):
    """Calls the command and returns result.json."""
    assert command.run(fit_command.main, [str(clip), "--out", str(out), *more]) == 0
    return json.loads((out / "result.json").read_text())


def without_times(result):
    return {key: value for key, value in result.items() if key != "timings_s"}


def deviation(entry, truth):
    """How many stated standard deviations the truth is off."""
    return abs(entry["mean"] - truth) / entry["sd"]


@pytest.fixture(scope="module")
def simulated(tmp_path_factory):
    """A track by the project's own simulator, and its truth."""
    folder = tmp_path_factory.mktemp("simulated")
    made = simulate(folder / "a.csv", track_only=True, seed=3)
    return folder / "a.yaml", made.truths[0]


@pytest.fixture(scope="module")
def first(simulated, tmp_path_factory):
    """The gradient fit of `simulated`: its folder and result."""
    out = tmp_path_factory.mktemp("fit") / "run"
    with in_64_bit():
        return out, call_fit(simulated[0], out)


@pytest.mark.slow
def test_recovers_the_truth(simulated, first):
    truth, (_, result) = simulated[1], first
    for name in ("k1", "k2"):
        assert deviation(result["parameters"][name], truth[name]) < SIGMAS
        assert result["parameters"][name]["identified"]
    assert deviation(result["derived"]["mass_ratio"], truth["m1"] / truth["m2"]) < SIGMAS
    assert result["derived"]["mass_ratio"]["identified"]
    assert not result["parameters"]["m1"]["identified"], "only mass ratios show"
    assert not result["parameters"]["m2"]["identified"]
    assert CHI2_RANGE[0] < result["error"]["chi2_per_dof"] < CHI2_RANGE[1]
    assert result["converged"]


@pytest.mark.slow
def test_result_keeps_the_contract(simulated, first):
    _, result = first
    contract = {"clips", "method", "converged", "effects", "parameters", "derived", "nuisances"}
    assert contract | {"error", "timings_s", "version", "seed"} <= set(result)
    assert list(result["parameters"]) == ["m1", "k1", "m2", "k2"]
    assert set(result["derived"]) == {"mass_ratio", "phi"}
    nuisances = {"start_offset_object1", "start_offset_object2", "foot_transition"}
    assert nuisances | {"release_instant", "noise_scale"} <= set(result["nuisances"])
    tables = result["parameters"] | result["derived"] | result["nuisances"]
    for name, entry in tables.items():
        assert set(entry) >= ENTRY, name
        assert entry["q025"] < entry["mean"] < entry["q975"], name
    assert {"rmse", "noise", "chi2_per_dof", "l1", "l2"} <= set(result["error"])
    assert {"track", "compile", "fit"} <= set(result["timings_s"])
    assert result["clips"] == [str(simulated[0])]
    assert result["method"] == "grad"
    assert result["effects"] == []
    assert result["engine"] in ("rigid", "c", "mjx")
    assert [result["parameters"][k]["unit"] for k in ("m1", "k1")] == ["kg", "1"]


@pytest.mark.slow
def test_leaves_a_run_that_can_be_read(first):
    out, result = first
    assert {"result.json", "report.html", "posterior.nc"} <= {path.name for path in out.iterdir()}
    run = load_run(out)
    assert run.result == result
    k1 = run.posterior["k1"].reshape(-1)
    assert k1.mean() == pytest.approx(result["parameters"]["k1"]["mean"])


@pytest.mark.slow
def test_same_seed_same_result_and_truth_beside_it(simulated, first, tmp_path, capsys):
    again = call_fit(simulated[0], tmp_path / "again")
    assert without_times(again) == without_times(first[1])
    shown = capsys.readouterr().out
    assert "truth" in shown.splitlines()[0]
    assert f"{simulated[1]['k1']:.4g}" in shown


def test_a_damaged_truth_is_said(simulated, tmp_path, capsys):
    clip = build_good_track(tmp_path)
    (tmp_path / "clip.truth.json").write_text('{"m1": 1}')
    assert command.run(fit_command.main, [str(clip), "--out", str(tmp_path / "run")]) == 2
    assert "clip.truth.json: not a truth with m1, k1, m2 and k2" in capsys.readouterr().err


@pytest.mark.slow
def test_recovers_a_world_of_points(tmp_path):
    """The reference shares nothing with the engines."""
    experiment = replace(HIT, friction=(0.13, 0.22), mass_kg=(0.6, 0.25))
    times = np.arange(45) / 30
    clip = write_clip(tmp_path, solve(experiment, times).position_m, times)
    result = fit(clip).result
    assert result["parameters"]["k1"]["mean"] == pytest.approx(0.13, abs=K1_ATOL)
    assert deviation(result["parameters"]["k1"], 0.13) < SIGMAS
    assert deviation(result["parameters"]["k2"], 0.22) < SIGMAS
    assert deviation(result["derived"]["mass_ratio"], 0.6 / 0.25) < SIGMAS


@pytest.mark.slow
def test_nothing_moves(tmp_path):
    times = np.arange(30) / 30
    still = replace(HIT, friction=(0.5, 0.2))
    clip = write_clip(tmp_path, solve(still, times).position_m, times)
    result = fit(clip).result
    for name, entry in (result["parameters"] | result["derived"]).items():
        assert not entry["identified"], name


@pytest.mark.slow
def test_one_object(tmp_path, capsys):
    """Its mass is in the result, as nothing tells it, and is not shown."""
    times = np.arange(40) / 30
    alone = replace(HIT, object2_x_m=None)
    clip = write_clip(tmp_path, solve(alone, times).position_m, times)
    result = call_fit(clip, tmp_path / "run")
    assert list(result["parameters"]) == ["m1", "k1"]
    assert result["derived"] == {}
    assert deviation(result["parameters"]["k1"], HIT.friction[0]) < SIGMAS
    assert not result["parameters"]["m1"]["identified"]
    shown = capsys.readouterr().out
    assert shown.count("k1") == 1
    assert "m1" not in shown and "m2" not in shown


@pytest.mark.slow
def test_incline(tmp_path):
    angle, k1 = math.radians(22), 0.3
    times = np.arange(90) / 120
    sin, cos = math.sin(angle), math.cos(angle)
    along = 0.5 * 9.81 * (sin - k1 * cos) * np.maximum(times - 0.1, 0) ** 2 - 0.5
    height = 0.03
    centres = np.array([[along * cos + height * sin, -along * sin + height * cos]])
    clip = write_clip(tmp_path, centres, times, "incline", ramp_angle_deg=22.0)
    result = fit(clip).result
    assert result["parameters"]["k1"]["identified"]
    assert deviation(result["parameters"]["k1"], k1) < SIGMAS


@pytest.mark.slow
@pytest.mark.video
def test_a_video(tmp_path):
    """Rendered, tracked and fitted."""
    video = tmp_path / "clip.mp4"
    (truth,) = simulate(video, seed=11, seconds=1.4, size=(480, 270)).truths
    result = fit(video).result
    assert result["parameters"]["k1"]["mean"] == pytest.approx(truth["k1"], abs=K1_ATOL)
    assert result["timings_s"]["track"] > 0


@pytest.mark.slow
@pytest.mark.video
@pytest.mark.parametrize("name", ["plain_coulomb_none_0"])
def test_shared_clips(name, shared_data):
    clip = shared_data / "ramp" / f"{name}.yaml"
    truth = json.loads((shared_data / "ramp" / f"{name}.truth.json").read_text())
    result = fit(clip).result
    assert result["parameters"]["k1"]["mean"] == pytest.approx(truth["k1"], abs=K1_ATOL)


@pytest.mark.slow
@pytest.mark.video
def test_a_slope_without_a_scale(shared_data):
    """The first clip says so; with a scale the same clip tells k1."""
    clip = shared_data / "real" / "slide_r1.yaml"
    unknown = fit(clip).parameters
    assert not unknown["k1"]["identified"]
    assert not unknown["pixels_per_metre"]["identified"]
    known = fit(clip, pixels_per_metre=490.0).parameters
    assert known["k1"]["identified"]
    assert "pixels_per_metre" not in known


class TestSampling:
    """Few steps: that it runs, repeats itself and goes on after a Ctrl-C."""

    SHORT = ("--method", "mh", "--max-steps", "50")

    @pytest.fixture(autouse=True)
    def short_warmup(self, monkeypatch):
        import_module("galileo_jax.inference.metropolis")  # needs the class in its annotations
        whole, short = driver.Settings, {"warmup_steps": 25, "stops_early": False}
        monkeypatch.setattr(driver, "Settings", lambda **given: whole(**(given | short)))

    @pytest.mark.slow
    def test_resumes_to_the_same_result(self, simulated, tmp_path, monkeypatch, capsys):
        undisturbed = call_fit(simulated[0], tmp_path / "once", *self.SHORT)
        assert undisturbed["method"] == "mh"
        assert not undisturbed["converged"], "fifty steps are too few, and it says so"

        shows, blocks = ProgressDisplay.__call__, []

        def stop_at_the_second_block(self, stage, *given):
            shows(self, stage, *given)
            blocks.extend([stage] * stage.startswith("sampling"))
            if len(blocks) == 2:
                raise KeyboardInterrupt

        out = tmp_path / "twice"
        monkeypatch.setattr(ProgressDisplay, "__call__", stop_at_the_second_block)
        words = [str(simulated[0]), "--out", str(out), *self.SHORT]
        assert command.run(fit_command.main, words) == 130
        assert "what was finished is saved" in capsys.readouterr().err
        assert not (out / "result.json").exists()
        assert list(out.iterdir()), "the checkpoint"
        monkeypatch.setattr(ProgressDisplay, "__call__", shows)
        resumed = call_fit(simulated[0], out, *self.SHORT)
        assert without_times(resumed) == without_times(undisturbed)
        assert not list(out.glob("*.checkpoint.npz"))


@pytest.mark.slow
def test_the_thesis_preset_says_what_it_chose(simulated):
    chosen: dict[str, Any] = {
        "similarity": "root_mean",
        "acceptance": "metropolis",
        "selection": "least_variance",
    }
    result = fit(simulated[0], method="mh", preset="thesis", **chosen).result
    assert {name: result[name] for name in chosen} == chosen
    assert result["preset"] == "thesis"
    assert set(result["best"]) == {"m1", "k1", "m2", "k2"}
    assert not result["converged"], "a point, and no posterior"


def test_a_file_in_the_place_of_the_run(tmp_path, capfd):
    clip = build_good_track(tmp_path)
    (tmp_path / "run").write_text("mine")
    assert command.run(fit_command.main, [str(clip), "--out", str(tmp_path / "run")]) == 2
    assert "is a file; a folder expected" in capfd.readouterr().err
    assert (tmp_path / "run").read_text() == "mine"


def test_the_same_clip_twice(tmp_path, capfd):
    clip = build_good_track(tmp_path)
    assert (
        command.run(fit_command.main, [str(clip), str(clip), "--out", str(tmp_path / "run")]) == 2
    )
    (line,) = capfd.readouterr().err.splitlines()
    assert "two clips are named clip" in line


@pytest.mark.slow
@pytest.mark.parametrize("engine", ["c", "rigid"])
def test_engines_of_the_command(simulated, first, tmp_path, engine):
    """MuJoCo's contacts tell the same of a clip; the whole command, in a process of its own."""
    out = tmp_path / "run"
    words = [str(simulated[0]), "--engine", engine, "--out", str(out)]
    subprocess.run([sys.executable, "-m", "galileo_jax.fit", *words], check=True)
    result, expected = json.loads((out / "result.json").read_text()), first[1]
    assert result["engine"] == engine
    assert result["motion"] == "planar"
    told = result["parameters"] | result["derived"]
    for name, entry in (expected["parameters"] | expected["derived"]).items():
        if entry["identified"]:
            assert abs(told[name]["mean"] - entry["mean"]) < ENGINES_SIGMAS * entry["sd"], name
            assert told[name]["sd"] == pytest.approx(entry["sd"], rel=ENGINES_SD_RTOL), name


@pytest.mark.slow
def test_what_stands_off_the_plane_is_warned_of(simulated, tmp_path, capsys):
    content = yaml.safe_load(simulated[0].read_text())
    content["track"] = str(simulated[0].with_suffix(".csv"))
    content["objects"][1]["z_m"] = 0.01
    (tmp_path / "off.yaml").write_text(yaml.safe_dump(content))
    result = call_fit(tmp_path / "off.yaml", tmp_path / "run")
    assert OFF_THE_PLANE in result["warnings"]
    assert "has a z_m" in " ".join(capsys.readouterr().err.split())
