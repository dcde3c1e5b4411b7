"""benchmarks/accelerator.py on whatever there is, with small batches."""

import importlib
import json
from pathlib import Path

import jax
import pytest

SCRIPTS = Path(__file__).resolve().parents[2] / "benchmarks"


def test_it_times_rollouts_and_fits(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.syspath_prepend(SCRIPTS)
    script = importlib.import_module("accelerator")
    few = ["--engine", "rigid", "c", "--batch", "2", "4", "--repeats", "1"]
    was_64_bit = jax.config.jax_enable_x64  # pyright: ignore
    try:
        assert script.main([*few, "--fits", "1", "--diagnoses", "0", "--together", "2"]) is None
    finally:
        jax.config.update("jax_enable_x64", was_64_bit)
    said = json.loads(capsys.readouterr().out.splitlines()[-1])
    for size in (2, 4):
        rates = said[f"rollouts_per_minute_{size}"]
        assert set(rates) == {"rigid", "c"}
        assert all(rate > 0 for rate in rates.values())
    assert said["fits_per_s"] > 0
    assert said["fits_per_s_together_2"] > 0
    assert said["diagnoses_per_minute"] == 0
