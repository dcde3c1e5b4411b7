"""A result is the same on another processor: other instructions round otherwise."""

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

from galileo_jax.api.simulate import simulate

ROOT = Path(__file__).resolve().parents[2]
INSTRUCTIONS = {"SSE4_2": "Nehalem", "AVX2": "Haswell"}  # XLA's, and OpenBLAS's with the same
MEAN_SD, END_SD = 0.02, 0.05
# A model that describes its data, one whose data contradict it, and a motion of another kind.
TRACKS = {
    "right": {"seed": 5},
    "wrong": {"seed": 3, "effects": {"air_drag": {}}, "strength": 1.0},
    "flight": {"seed": 1, "scenario": "flight"},
}


def result_on(instructions: str, track: Path, folder: Path) -> dict:
    environment = os.environ | {
        "XLA_FLAGS": f"--xla_cpu_max_isa={instructions}",
        "OPENBLAS_CORETYPE": INSTRUCTIONS[instructions],
        "XDG_CACHE_HOME": str(ROOT / "build" / "instructions" / instructions),
        "PYTHONPATH": str(ROOT),
    }
    environment.pop("JAX_COMPILATION_CACHE_DIR", None)
    out = folder / instructions
    call = [sys.executable, "-m", "galileo_jax.fit", str(track), "--out", str(out)]
    subprocess.run(call, env=environment, check=True, capture_output=True)
    return json.loads((out / "result.json").read_text())


@pytest.mark.slow
@pytest.mark.parametrize("name", TRACKS)
def test_a_fit_is_the_same_with_other_instructions(name, tmp_path):
    track = tmp_path / "track.csv"
    simulate(track, track_only=True, **TRACKS[name])
    one, other = (result_on(each, track, tmp_path) for each in INSTRUCTIONS)
    assert one["status"] == other["status"]
    for room in ("parameters", "derived", "nuisances"):
        for key, entry in one[room].items():
            there = other[room][key]
            assert there["mean"] == pytest.approx(entry["mean"], abs=MEAN_SD * entry["sd"])
            for end in ("q025", "q975"):
                assert there[end] == pytest.approx(entry[end], abs=END_SD * entry["sd"])
