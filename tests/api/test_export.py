"""`export`: the function and the command write the same bytes, refuse with the same sentence."""

from pathlib import Path

import pytest

from galileo_jax.api.export import export
from galileo_jax.commands import command
from galileo_jax.commands import export as export_command
from galileo_jax.runtime.errors import InputError
from tests.clip.broken_clips import build_good_track
from tests.commands.test_export import make_run
from tests.oracle_run import HIT
from tests.oracle_run import make_run as make_oracle_run
from tests.precision import in_64_bit


def run(*argv: object) -> int:
    return command.run(export_command.main, [str(part) for part in argv])


def contents(folder: Path) -> dict[str, bytes]:
    return {path.name: path.read_bytes() for path in folder.iterdir()}


@pytest.mark.parametrize("to", ["csv", "parquet", "netcdf"])
@pytest.mark.parametrize("what", ["run", "clip"])
def test_the_function_writes_what_the_command_writes(what, to, tmp_path, capsys) -> None:
    source = make_run(tmp_path / "run") if what == "run" else build_good_track(tmp_path)
    done = export(source, to=to, out=tmp_path / "function")
    assert capsys.readouterr() == ("", "")
    assert run(source, "--to", to, "--out", tmp_path / "command") == 0
    printed = capsys.readouterr().out.split()
    assert printed == [str(tmp_path / "command" / path.name) for path in done.paths]
    assert {path.name for path in done.paths} == contents(tmp_path / "function").keys()
    assert contents(tmp_path / "function") == contents(tmp_path / "command")


def test_the_figures_of_a_fit(tmp_path, capsys) -> None:
    with in_64_bit():
        folder = make_oracle_run(tmp_path, HIT, 0.9).folder
    done = export(folder, to="svg")
    assert "velocity_object1_x.svg" in {path.name for path in done.paths}
    assert {path.parent for path in done.paths} == {folder / "export"}
    assert all(path.read_text(encoding="utf-8").rstrip().endswith("</svg>") for path in done.paths)
    assert run(folder, "--to", "svg") == 0
    assert capsys.readouterr().out.split() == [str(path) for path in done.paths]


def test_where_it_is_written_if_nothing_is_said(tmp_path, monkeypatch) -> None:
    monkeypatch.chdir(tmp_path)
    folder = make_run(tmp_path / "run")
    assert export(folder, to="csv").paths[0] == folder / "export" / "track.csv"
    assert export(build_good_track(tmp_path), to="csv").paths == (Path("clip_export/track.csv"),)


@pytest.mark.parametrize(
    ("words", "given"),
    [
        ("none --to csv", {"source": "none", "to": "csv"}),
        ("run --to cvs", {"source": "run", "to": "cvs"}),
        ("empty --to csv", {"source": "empty", "to": "csv"}),
        ("clip.csv --to csv --fitted", {"source": "clip.csv", "to": "csv", "fitted": True}),
        (
            "run --to csv --out run/result.json",
            {"source": "run", "to": "csv", "out": "run/result.json"},
        ),
    ],
)
def test_wrong_calls_are_refused_with_the_commands_sentence(
    words, given, tmp_path, capsys, monkeypatch
) -> None:
    monkeypatch.chdir(tmp_path)
    make_run(tmp_path / "run")
    build_good_track(tmp_path)
    (tmp_path / "empty").mkdir()
    assert run(*words.split()) == 2
    sentence = capsys.readouterr().err
    with pytest.raises(InputError) as caught:
        export(**given)
    assert f"error: {caught.value}\n" == sentence
