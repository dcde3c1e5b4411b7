"""The runner: what there is, and how a benchmark is called."""

import argparse
import importlib
import subprocess
import sys
from pathlib import Path
from typing import Literal

import pytest

from benchmarks.__main__ import declare, main, summaries
from benchmarks.journal import Journal
from galileo_jax.commands import command

ROOT = Path(__file__).resolve().parents[2]
MODULES = {path.stem for path in (ROOT / "benchmarks").glob("[!_]*.py")}


def test_without_a_name_every_benchmark_is_listed_with_a_line(capsys):
    assert main([]) is None
    listed = capsys.readouterr().out.splitlines()[2:]
    assert [line.split()[0] for line in listed] == sorted(summaries())
    assert all(len(line) > 30 for line in listed)


def test_unknown_name(capsys):
    assert command.run(main, ["samplerz"]) == 2
    assert "unknown benchmark 'samplerz'; known: accelerator" in capsys.readouterr().err


@pytest.mark.parametrize("name", sorted(set(summaries()) - {"bullet_effects"}))
def test_every_benchmark_says_how_it_is_called(name, capsys):
    with pytest.raises(SystemExit):
        main([name, "--help"])
    text = capsys.readouterr().out
    if name == "accelerator":
        assert "python benchmarks/accelerator.py" in text
    else:
        assert f"python -m benchmarks {name}" in text.split("\n\n", 1)[1]


def test_modules_that_are_no_benchmark_can_be_imported():
    for name in MODULES - set(summaries()) - {"bullet_scene", "exotic_effects"}:
        importlib.import_module(f"benchmarks.{name}")


def test_accelerator_is_called_as_a_script(tmp_path):
    call = [sys.executable, str(ROOT / "benchmarks" / "accelerator.py"), "--help"]
    done = subprocess.run(call, cwd=tmp_path, capture_output=True, text=True, check=True)
    assert "--together" in done.stdout


def test_parameters_are_the_arguments():
    def benchmark(
        folder: Path,
        more: tuple[Path, ...] = (),
        *,
        out: Path,
        num: int = 3,
        kind: Literal["a", "b"] = "a",
        parts: tuple[str, ...] = ("x", "y"),
        share: float | None = None,
        quiet: bool = False,
    ): ...

    parser = argparse.ArgumentParser(exit_on_error=False)
    declare(parser, benchmark)
    plain = {"num": 3, "kind": "a", "parts": ("x", "y"), "share": None, "quiet": False}
    said = vars(parser.parse_args(["f", "--out", "o"]))
    assert said == {"folder": Path("f"), "more": (), "out": Path("o"), **plain}
    call = "f g h --out o --num 4 --kind b --parts y --share 0.5 --quiet"
    assert vars(parser.parse_args(call.split())) == {
        "folder": Path("f"),
        "more": [Path("g"), Path("h")],
        "out": Path("o"),
        "num": 4,
        "kind": "b",
        "parts": ["y"],
        "share": 0.5,
        "quiet": True,
    }
    with pytest.raises(argparse.ArgumentError, match="--parts"):
        parser.parse_args(["f", "--out", "o", "--parts", "z"])


def test_a_journal_goes_on_and_tries_again_what_failed(tmp_path):
    path = tmp_path / "deep" / "results.jsonl"
    journal = Journal(path)
    assert journal.row("a", lambda: {"value": 1})["value"] == 1
    assert journal.tried("b", lambda: {"value": 1 // 0})["error"].startswith("ZeroDivisionError")
    with path.open("a") as file:
        file.write('\n{"case": "c", "val')
    again = Journal(path)
    assert again.row("a", lambda: {"value": 2})["value"] == 1
    assert set(again.rows) == {"a"}
    assert again.tried("b", lambda: {"value": 3}) == {"case": "b", "value": 3, "error": None}
    assert set(Journal(path).rows) == {"a", "b"}
