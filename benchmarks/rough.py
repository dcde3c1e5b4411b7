"""Friction with imperfections of fixed sizes, and with sizes that are inferred, side by side.

    python benchmarks/rough.py CLIP ... [--together] [--num 20 --seed 700000]

CLIP: clips with their yaml; `--together`: one joint fit of all. Without clips: `--num` tracks of
ramps that this program draws. Where a truth is known, each error is counted in the stated sds.
"""

import argparse
import json
import re
import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import tables

import galileo_jax as gx

WAYS = ("none", "rough")
COLUMNS = ("clip", "way", "k1", "k2", "off, sds", "chi2 or p", "larger than usual")


def main() -> None:
    """Prints a row for each fit, and how well the stated sds are kept."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n")[0])
    parser.add_argument("clips", type=Path, nargs="*")
    parser.add_argument("--together", action="store_true")
    parser.add_argument("--num", type=int, default=20)
    parser.add_argument("--seed", type=int, default=700_000)
    asked = parser.parse_args()
    with tempfile.TemporaryDirectory() as scratch:
        each = [[path] for path in asked.clips] or [
            [_drawn(Path(scratch), asked.seed + i)] for i in range(asked.num)
        ]
        tables.row(COLUMNS[0], COLUMNS[1:])
        off: dict[str, list[float]] = {way: [] for way in WAYS}
        for clips in [asked.clips] if asked.together else each:
            for way in WAYS:
                off[way] += _row(clips, way)
    for way, values in off.items():
        if values:
            inside = float(np.mean(np.abs(values) < 1.96))
            tables.finish(f"rough {way}", {"rms": float(np.std(values)), "inside": inside})


def _drawn(folder: Path, seed: int) -> Path:
    path = folder / f"{seed}.csv"
    gx.simulate(path, seed=seed, track_only=True, track_noise=2e-4)
    return path


def _row(clips: Sequence[Path], way: str) -> list[float]:
    """Fits and prints; by how many sds k1, k2 and the ratio's logarithm are off."""
    fit = gx.fit(list(clips), discrepancy=way)  # pyright: ignore[reportArgumentType]
    known = {n: e for n, e in fit.parameters.items() if re.fullmatch(r"k\d", n)}
    shown = [
        f"{e['mean']:.4f} +- {e['sd']:.4f}" if e["identified"] else "open" for e in known.values()
    ]
    truth, off = _truth(clips[0]), {}
    for name, entry in known.items():
        if entry["identified"] and name in truth:
            off[name] = (entry["mean"] - truth[name]) / entry["sd"]
    ratio = fit.result["derived"].get("mass_ratio")
    if ratio and ratio["identified"] and {"m1", "m2"} <= set(truth):
        off["ratio"] = (ratio["mean"] - truth["m1"] / truth["m2"]) / ratio["sd"]
    sizes = fit.result.get("imperfections", {})
    judged = f"chi2 {fit.result['error']['chi2_per_dof']:.2f}"
    if sizes:
        judged = f"p {gx.compare(fit).p_value:.2g}"
    larger = " ".join(f"{n} {e['mean']:.2g}" for n, e in sizes.items() if not e["ordinary"])
    told = " ".join(f"{value:+.1f}" for value in off.values())
    tables.row(clips[0].stem, (way, *[*shown, "", ""][:2], told, judged, larger))
    return list(off.values())


def _truth(clip: Path) -> dict[str, Any]:
    path = clip.with_suffix(".truth.json")
    return json.loads(path.read_text()) if path.is_file() else {}


if __name__ == "__main__":
    main()
