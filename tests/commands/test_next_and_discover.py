"""`galileo next` and `galileo discover`: what they print, and wrong calls in one line."""

import json
import types

import galileo_jax as gx
from galileo_jax import __main__
from galileo_jax.commands import command


def galileo(*words: object) -> int:
    return command.run(__main__.main, [str(word) for word in words])


def test_next_prints_the_table_and_the_sentence(tmp_path, monkeypatch, capsys):
    asked = {}

    def fake(**options):
        asked.update(options)
        row = {"height": 0.15, "gain_nats": 0.6, "named": 0.93, "lead_nats": 8.0, "hit": None}
        return types.SimpleNamespace(
            hypotheses={"air_drag": 0.7, "none": 0.3},
            document={"settings": [row]},
            sentence="release object 1 from 0.15 m: named with probability 0.93",
            save=lambda folder: folder,
        )

    monkeypatch.setattr(gx, "next_experiment", fake, raising=False)
    assert galileo("next", tmp_path, "--can", "height=0.1:0.5", "--about", "k2") == 0
    out = capsys.readouterr().out
    assert "still possible: air_drag 0.700, none 0.300" in out and "0.93" in out
    assert out.splitlines()[-1].startswith("release object 1 from 0.15 m")
    del asked["on_progress"]
    assert asked == {"found": [tmp_path], "can": "height=0.1:0.5", "about": "k2"}


def test_a_damaged_diagnosis_is_one_line(tmp_path, capsys):
    (tmp_path / "diagnosis.json").write_text("[1]")
    assert galileo("next", tmp_path) == 2
    assert "not a diagnosis" in capsys.readouterr().err


def test_discover_prints_every_experiment(tmp_path, monkeypatch, capsys):
    """A lab that is out of order: every experiment is one line, and the exit code is 0."""
    lab = tmp_path / "lab.py"
    described = {"settings": {"height_m": {"low": 0.1, "high": 0.2}}, "clip": {"scenario": "ramp"}}
    lab.write_text(
        "import sys, json\n"
        f"if len(sys.argv) > 1: print({json.dumps(described)!r})\n"
        "else: print('out of order', file=sys.stderr); sys.exit(1)\n"
    )
    assert galileo("discover", lab, "--budget", 2, "--out", tmp_path / "run") == 0
    out = capsys.readouterr().out
    assert out.count("lost: exit code 1: out of order") == 2
    assert "No experiment delivered a track." in out
    assert (tmp_path / "run" / "report.html").is_file()
    assert len(json.loads((tmp_path / "run" / "discover.json").read_text())["experiments"]) == 2
