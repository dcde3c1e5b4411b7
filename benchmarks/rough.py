"""Is friction right with imperfections of fixed sizes, and with sizes that are inferred?

    python -m benchmarks rough CLIP ... [--together]
    python -m benchmarks rough --num 20 --seed 700000

CLIP: clips with their yaml; `--together`: one joint fit of all. Without clips: `--num` tracks of
ramps that this program draws. Where a truth is known, each error is counted in the stated sds.
"""

import json
import re
import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

import galileo_jax as gx
from benchmarks import scoring, tables

WAYS = ("none", "rough")
COLUMNS = ("way", "k1", "k2", "off, sds", "chi2 or p", "larger than usual")


def main(
    clips: tuple[Path, ...] = (), *, together: bool = False, num: int = 20, seed: int = 700_000
) -> dict[str, Any]:
    off: dict[str, list[float]] = {way: [] for way in WAYS}
    tables.row("clip", COLUMNS)
    with tempfile.TemporaryDirectory() as scratch:
        drawn = () if clips else [_drawn(Path(scratch), each) for each in range(seed, seed + num)]
        for group in [clips] if together else [(path,) for path in (*clips, *drawn)]:
            for way in WAYS:
                off[way] += _row(group, way)
    return {
        way: {"rms": float(np.std(values)), "inside": float(np.mean(np.abs(values) < 1.96))}
        for way, values in off.items()
        if values
    }


def _drawn(folder: Path, seed: int) -> Path:
    path = folder / f"{seed}.csv"
    gx.simulate(path, seed=seed, track_only=True, track_noise=2e-4)
    return path


def _row(clips: Sequence[Path], way: str) -> list[float]:
    """Fits and prints; by how many sds k1, k2 and the mass ratio are off."""
    fit = gx.fit(list(clips), discrepancy=way)  # pyright: ignore[reportArgumentType]
    entries = scoring.of_result(fit.result)
    frictions = [name for name in fit.parameters if re.fullmatch(r"k\d", name)]
    told = [name for name in (*frictions, "mass_ratio") if name in entries]
    truth = _truth(clips[0])
    off = [
        scoring.of_entry(entries[name], truth[name]).z
        for name in told
        if entries[name]["identified"] and name in truth
    ]
    shown = [
        f"{entries[name]['mean']:.4f} +- {entries[name]['sd']:.4f}"
        if entries[name]["identified"]
        else "open"
        for name in frictions
    ]
    sizes = fit.result.get("imperfections", {})
    judged = f"chi2 {fit.result['error']['chi2_per_dof']:.2f}"
    if sizes:
        judged = f"p {gx.compare(fit).p_value:.2g}"
    larger = " ".join(f"{n} {e['mean']:.2g}" for n, e in sizes.items() if not e["ordinary"])
    sds = " ".join(f"{value:+.1f}" for value in off)
    tables.row(clips[0].stem, (way, *[*shown, "", ""][:2], sds, judged, larger))
    return off


def _truth(clip: Path) -> dict[str, Any]:
    """The true values, if they are known."""
    path = clip.with_suffix(".truth.json")
    truth = json.loads(path.read_text()) if path.is_file() else {}
    if {"m1", "m2"} <= set(truth):
        truth["mass_ratio"] = truth["m1"] / truth["m2"]
    return truth
