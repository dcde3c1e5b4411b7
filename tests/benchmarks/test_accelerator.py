"""benchmarks/accelerator.py on whatever there is, with small batches."""

import json

import pytest

from benchmarks.__main__ import main


@pytest.mark.slow
def test_it_times_rollouts_and_fits(capsys: pytest.CaptureFixture[str]) -> None:
    few = ["--engine", "rigid", "c", "--batch", "2", "4", "--repeats", "1"]
    assert main(["accelerator", *few, "--fits", "1", "--diagnoses", "0", "--together", "2"]) is None
    said = json.loads(capsys.readouterr().out.splitlines()[-1])
    for size in (2, 4):
        rates = said[f"rollouts_per_minute_{size}"]
        assert set(rates) == {"rigid", "c"}
        assert all(rate > 0 for rate in rates.values())
    assert said["fits_per_s"] > 0
    assert said["fits_per_s_together_2"] > 0
    assert said["diagnoses_per_minute"] == 0
