"""Do MuJoCo's engines give the rigid engine's posterior? `python benchmarks/engines.py`.

Each fit is a process of its own, `python -m galileo_jax.fit CLIP --engine E --method M`, as a user
would call it. Per fit, against the same fit with `--engine rigid`: for k1, k2 and the mass ratio
the difference of the means in that fit's standard deviations, the ratio of the standard
deviations; seconds of the fit itself (as result.json tells them) and processor seconds of the
whole process. The clips are tracks made by `simulate --track-only` unless some are named. The
last line is JSON.
"""

import argparse
import json
import resource
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import tables

from galileo_jax.api.simulate import simulate
from galileo_jax.commands import command

SHOWN = ("k1", "k2", "mass_ratio")
COLUMNS = (*(f"d {name}" for name in SHOWN), *(f"sd {name}" for name in SHOWN), "fit s", "cpu s")
SEEDS = (1, 2, 3)
METHODS = ("grad", "mh")
SECONDS = 2.0  # of a clip: 60 frames


def main(argv: Sequence[str]) -> int | None:
    """Prints a row per fit and one line of JSON."""
    call = _parser().parse_args(argv)
    figures: dict[str, Any] = {}
    with tempfile.TemporaryDirectory() as folder:
        clips = call.clips or [_simulated(Path(folder), seed) for seed in call.seeds or SEEDS]
        tables.row("clip, method, engine", COLUMNS)
        for clip in clips:
            for method in call.method or METHODS:
                reference = None
                for engine in ("rigid", *(call.engine or ["c"])):
                    label = f"{clip.stem} {method} {engine}"
                    found = _fitted(clip, method, engine, Path(folder) / label.replace(" ", "_"))
                    reference = reference or found
                    figures[label] = _against(found, reference)
                    tables.row(label, list(figures[label].values()))
    tables.finish("engines", figures)
    return None


def _simulated(folder: Path, seed: int) -> Path:
    track = folder / f"track{seed}.csv"
    simulate(track, track_only=True, seconds=SECONDS, seed=seed)
    return track


def _fitted(clip: Path, method: str, engine: str, out: Path) -> dict[str, Any]:
    """What result.json says, and the processor seconds that it took."""
    options = ["--method", method, "--engine", engine, "--out", str(out)]
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    subprocess.run(
        [sys.executable, "-m", "galileo_jax.fit", str(clip), *options],
        check=True,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
    )
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    result = json.loads((out / "result.json").read_text(encoding="utf-8"))
    spent = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
    return result | {"cpu_s": spent}


def _against(found: dict[str, Any], reference: dict[str, Any]) -> dict[str, Any]:
    """One row."""
    told, expected = (one["parameters"] | one["derived"] for one in (found, reference))
    off = {
        f"d {name}": (told[name]["mean"] - expected[name]["mean"]) / expected[name]["sd"]
        for name in SHOWN
    }
    wide = {f"sd {name}": told[name]["sd"] / expected[name]["sd"] for name in SHOWN}
    return off | wide | {"fit s": found["timings_s"]["fit"], "cpu s": found["cpu_s"]}


def _parser() -> command.Parser:
    parser = command.Parser(prog="engines.py", description=__doc__)
    parser.formatter_class = argparse.RawDescriptionHelpFormatter
    parser.add_argument("clips", nargs="*", type=Path, metavar="CLIP", help="default: simulated")
    parser.add_argument("--seeds", type=int, nargs="+", help="of the simulated clips")
    parser.add_argument("--method", action="append", choices=METHODS)
    parser.add_argument("--engine", action="append", choices=("c", "mjx"))
    return parser


if __name__ == "__main__":
    raise SystemExit(command.run(main))
