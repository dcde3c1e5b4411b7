"""`train`: a training of three epochs, and the command's sentences."""

import threading

import numpy as np
import pytest

from galileo_jax.api.train import evaluate_network, train
from galileo_jax.commands import command
from galileo_jax.commands import train as train_command
from galileo_jax.runtime.errors import InputError
from galileo_jax.runtime.progress import Cancelled

TINY = {"preset": "thesis", "samples": 100, "max_epochs": 3, "frames": 25}


@pytest.mark.slow
def test_it_trains_reports_and_goes_on(tmp_path, capsys):
    cancel, stages = threading.Event(), []

    def on_progress(stage, share, partial):
        stages.append((stage, share))
        if stage == "training":
            assert len(partial.losses) == partial.epoch
            cancel.set()

    with pytest.raises(Cancelled):
        train(tmp_path / "a", **TINY, on_progress=on_progress, cancel=cancel)
    assert not (tmp_path / "a" / "network.npz").exists()
    done = train(tmp_path / "a", **TINY, on_progress=lambda *report: stages.append(report[:2]))
    assert [stage for stage, _ in stages] == ["simulating", "training"] * 2
    assert stages[-1] == ("training", 1.0)
    assert len(done.losses) == 3
    assert capsys.readouterr().out == ""
    words = "--preset thesis --samples 100 --max-epochs 3 --frames 25 --out"
    assert command.run(train_command.main, [*words.split(), str(tmp_path / "b")]) == 0
    assert "3 epochs, validation loss" in capsys.readouterr().out
    first, second = (np.load(tmp_path / name / "network.npz") for name in "ab")
    assert all(np.array_equal(first[name], second[name]) for name in first.files)


@pytest.mark.parametrize(
    ("words", "given"),
    [
        ("--preset thesies", {"preset": "thesies"}),
        ("--samples 50", {"samples": 50}),
        ("--max-epochs 0", {"max_epochs": 0}),
        ("--seed -1", {"seed": -1}),
        ("--engine mujoco", {"engine": "mujoco"}),
        ("--engine c", {"engine": "c"}),
        ("--config none.yaml", {"config": "none.yaml"}),
    ],
)
def test_wrong_calls_are_refused_with_the_commands_sentence(
    words, given, tmp_path, capsys, monkeypatch
):
    monkeypatch.chdir(tmp_path)
    assert command.run(train_command.main, [*words.split(), "--out", "out"]) == 2
    sentence = capsys.readouterr().err
    with pytest.raises(InputError) as caught:
        train("out", **given)
    assert f"error: {' '.join(str(caught.value).split())}\n" == sentence
    assert list(tmp_path.iterdir()) == []


def test_what_is_no_network_is_refused(tmp_path, capsys):
    assert command.run(train_command.main, ["--test", str(tmp_path)]) == 2
    sentence = capsys.readouterr().err
    with pytest.raises(InputError) as caught:
        evaluate_network(tmp_path)
    assert f"error: {caught.value}\n" == sentence
    assert command.run(train_command.main, ["--test", str(tmp_path), "--seed", "1"]) == 2
    assert "--seed: --test trains nothing" in capsys.readouterr().err
