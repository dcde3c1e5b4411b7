"""A bundle: what somebody needs who is to help, and nothing else."""

import getpass
import json
import socket
import zipfile
from pathlib import Path

import numpy as np
import pytest
import yaml

import galileo_jax as gx
from galileo_jax import __main__
from galileo_jax.api import bundle as module
from galileo_jax.api.bundle import bundle_of_failure
from galileo_jax.clip.load import check_clip, load_clip
from galileo_jax.commands import command
from galileo_jax.measurement.measure import measure
from galileo_jax.results.impersonal import impersonal
from galileo_jax.runtime.errors import InputError
from tests.api.test_understand import filmed

PERSONAL = ("Anna", "anna", "Rutsche", "Schule")


def unpacked(path: Path, to: Path) -> dict[str, str]:
    """Its texts by name; it is unpacked into a folder."""
    with zipfile.ZipFile(path) as archive:
        archive.extractall(to)
        assert {one.date_time for one in archive.infolist()} == {module.MADE}
    return {
        one.name: one.read_text("utf-8") for one in sorted(to.iterdir()) if one.suffix != ".npz"
    }


def check_impersonal(texts: dict[str, str], folder: Path) -> None:
    users = () if getpass.getuser() == "root" else (getpass.getuser(),)
    for name, text in texts.items():
        for word in (*PERSONAL, str(folder), "/home/", socket.gethostname(), *users):
            assert word not in text, f"{word} in {name}"
            assert word not in name


@pytest.fixture(scope="module")
def board(tmp_path_factory) -> Path:
    """A table of one coordinate, with a name and a remark that are somebody's."""
    folder = tmp_path_factory.mktemp("Schule")
    path = folder / "Annas Rutsche.csv"
    t = np.arange(25) / 25
    noise = np.random.default_rng(5).normal(0, 2e-4, t.size)
    rows = "\n".join(f"{a:.3f};{b:.5f}" for a, b in zip(t, 0.4 * t**2 + noise, strict=True))
    path.write_text(f"# filmed by Anna\nt (s);s (m)\n{rows}\n")
    keys = {"track": path.name, "scenario": "incline", "ramp_angle_deg": 20.0}
    objects = [{"name": "AnnasKlotz", "shape": "box"}]
    path.with_suffix(".yaml").write_text(yaml.safe_dump({**keys, "objects": objects}))
    return path


@pytest.fixture(scope="module")
def found(board) -> gx.Explanation:
    return gx.explain(board)


def test_a_bundle_is_fitted_again_to_the_same_numbers(found, board, tmp_path):
    made = found.bundle(tmp_path / "out" / "bundle.zip")
    texts = unpacked(made.path, tmp_path / "unpacked")
    check_impersonal(texts, board.parent)
    assert (
        set(made.names)
        == {*texts, "clip1.errors.npz"}
        >= {
            *("clip1.csv", "clip1.yaml", "result.json", "compare.json", "versions.json"),
            *("command.txt", "look.txt", "README.txt"),
        }
    )
    assert "no film, no picture" in made.line
    assert texts["command.txt"] == "galileo explain clip1.csv\n"
    assert json.loads(texts["compare.json"])["could_not_see"] == found.could_not_see != {}
    assert set(json.loads(texts["versions.json"])) >= {"galileo_jax", "Python", "jax", "numpy"}
    again = gx.explain(tmp_path / "unpacked" / "clip1.csv")
    told = json.loads(texts["result.json"])
    for name, entry in told["parameters"].items():
        one = again.fit.parameters[name]
        near_zero = 2e-5 * entry["sd"]  # as the speed from rest
        assert one["mean"] == pytest.approx(entry["mean"], rel=1e-6, abs=near_zero)
        # The error along the way is what rounding leaves beside that across it, which is 10 m.
        assert one["sd"] == pytest.approx(entry["sd"], rel=1e-3)
    assert again.paragraph == found.paragraph == texts["paragraph.txt"].strip()


@pytest.mark.video
def test_the_track_of_a_film_is_measured_again_as_the_film_was(tmp_path):
    way = 0.09 * np.maximum(np.arange(30.0) - 4, 0) ** 2
    film = filmed(tmp_path, np.stack([40 + way, 30 + 0.36 * way, 0 * way], axis=1))
    content = {
        **{"video": film.name, "scenario": "incline", "fps": 30.0, "ramp_angle_deg": 20.0},
        **{"pixels_per_metre": 300.0, "direction": "right"},
        "objects": [{"name": "object1", "shape": "box", "point_px": [40.0, 30.0]}],
    }
    measured = measure(check_clip(film.with_suffix(".yaml"), content))
    hidden = impersonal([[film]])
    for name, data in module._track_files(measured, "clip1", hidden).items():
        (tmp_path / name).write_bytes(data)
    clip = load_clip(tmp_path / "clip1.csv")
    assert clip.warnings == (), "no key is left that means nothing beside a track"
    again = measure(clip)
    for seen, first in (
        (again.whole, measured.whole),
        (again.observation, measured.observation),
    ):
        np.testing.assert_array_equal(seen.mask, first.mask)
        np.testing.assert_array_equal(seen.position_m, first.position_m)
        np.testing.assert_allclose(seen.covariance_m2, first.covariance_m2, rtol=1e-9)
        assert seen.noise_known_to == first.noise_known_to > 0
        assert seen.num_errors == first.num_errors
        np.testing.assert_array_equal(
            np.zeros(0) if seen.modes_m is None else seen.modes_m,
            np.zeros(0) if first.modes_m is None else first.modes_m,
        )


def test_of_a_call_that_fails_there_is_what_was_understood_and_why(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    Path("Schule").mkdir()
    t = np.arange(20) / 25
    rows = "\n".join(f"{a:.3f};{0.4 * a * a:.5f}" for a in t)
    Path("Schule/Annas Rutsche.csv").write_text(f"t (s);s (m)\n{rows}\n")
    assert command.run(__main__.main, ["Schule/Annas Rutsche.csv", "--bundle"]) == 2
    out, err = capsys.readouterr()
    told, error = err.splitlines()
    assert out == "" and error.startswith("error: Schule/Annas Rutsche.csv: there is no")
    assert told.startswith("runs/Annas Rutsche/bundle.zip: README.txt, ")
    texts = unpacked(Path("runs/Annas Rutsche/bundle.zip"), tmp_path / "unpacked")
    check_impersonal(texts, tmp_path)
    assert texts["error.txt"].startswith("clip1.csv: there is no clip1.yaml beside it")
    assert "moves: object1 by" in texts["look.txt"]
    assert texts["command.txt"] == "galileo explain clip1.csv --bundle\n"


def test_of_a_bug_there_is_the_track_and_the_traceback(board, tmp_path, monkeypatch, capsys):
    def broken(*_, **__):
        raise ZeroDivisionError(f"in {board.parent}/Anna.txt")

    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(gx, "explain", broken)
    with pytest.raises(ZeroDivisionError):
        command.run(__main__.main, [str(board), "--bundle", "--out", "Annas results"])
    texts = unpacked(tmp_path / "Annas results" / "bundle.zip", tmp_path / "unpacked")
    check_impersonal(texts, board.parent)
    assert "Traceback" in texts["error.txt"] and "ZeroDivisionError" in texts["error.txt"]
    assert 'File "galileo_jax/commands/explain.py"' in texts["error.txt"]
    assert "--out out" in texts["command.txt"]
    assert load_clip(tmp_path / "unpacked" / "clip1.csv").objects[0].name == "object1"


def test_a_file_that_is_not_there_has_a_bundle_too(tmp_path):
    error = InputError(f"{tmp_path}/anna.mp4: no such file")
    made = bundle_of_failure([tmp_path / "anna.mp4"], error, tmp_path / "b.zip")
    texts = unpacked(made.path, tmp_path / "unpacked")
    check_impersonal(texts, tmp_path)
    assert texts["error.txt"] == texts["look.txt"] == "clip1.mp4: no such file\n"
    assert "To do the same again" not in texts["README.txt"]


def test_a_place_that_cannot_be_written_is_one_line(tmp_path):
    (tmp_path / "file").write_text("")
    with pytest.raises(InputError, match=r"bundle\.zip: the bundle: "):
        bundle_of_failure([], ValueError("x"), tmp_path / "file" / "bundle.zip")
