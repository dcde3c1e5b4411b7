"""How well are clips with a known truth fitted?

    python -m benchmarks accuracy FOLDER

Every NAME.yaml of FOLDER with a NAME.truth.json goes through all of `galileo fit`, tracking
included. Where the truth says that nothing can be told (object 2 never hit, nothing moves), the
fit has to say so, too. The mass ratio's errors are relative.
"""

import json
import time
from collections.abc import Iterator, Mapping
from fnmatch import fnmatch
from pathlib import Path
from typing import Any, Literal

import numpy as np

from benchmarks import scoring, tables
from galileo_jax.api.fit import fit
from galileo_jax.runtime.errors import InputError

ALL = {"coverage": (0.85, 1.0), "missed": (0, 0), "claimed": (0, 0)}
BARS = {
    "k1": {"median": (0.0, 0.003), "worst": (0.0, 0.01), **ALL},
    "k2": {"median": (0.0, 0.01), **ALL},
    "mass_ratio": {"median": (0.0, 0.05), "worst": (0.0, 0.15), **ALL},
}
CHI2 = (0.7, 1.5)
COLUMNS = (
    *("k1 err", "z", "in 95%", "k2 err", "z", "in 95%", "ratio err", "z", "in 95%"),
    *("chi2/dof", "noise", "converged", "seconds"),
)


def main(
    folder: Path,
    *,
    method: Literal["grad", "mh", "cnn"] = "grad",
    only: str = "",
    set: str = "none",
    seed: int = 0,
) -> dict[str, Any]:
    scores, chi2, seconds, failures = [], [], [], {}
    tables.row("clip", COLUMNS)
    for path, truth in clips_with_truth(folder, only, set):
        began = time.perf_counter()
        try:
            result = fit(path, method=method, seed=seed).result
        except InputError as error:
            failures[path.stem] = str(error)
            print(f"{path.stem:<28} {error}", flush=True)
            continue
        seconds.append(time.perf_counter() - began)
        scores.append(scored(result, truth))
        chi2.append(result["error"]["chi2_per_dof"])
        cells = [cell for entry in scores[-1].values() for cell in entry.cells()]
        noise = result["nuisances"].get("noise_scale", {}).get("mean")
        tables.row(path.stem, [*cells, chi2[-1], noise, result["converged"], seconds[-1]])
    if not scores:
        raise InputError(f"{folder}: no clip could be fitted")
    table = scoring.summary(scores)
    print()
    tables.by_name("quantity", table)
    missed = scoring.missed(table, BARS)
    if outside := sum(not CHI2[0] <= value <= CHI2[1] for value in chi2):
        missed.append(f"chi2/dof outside {CHI2} in {outside}")
    return {
        "method": method,
        "clips": len(scores),
        "failures": failures,
        **table,
        "chi2_per_dof": chi2,
        "seconds_median": float(np.median(seconds)),
        "seconds_worst": max(seconds),
        "bars_missed": tables.missed(missed),
    }


def clips_with_truth(
    folder: Path, only: str, effect: str
) -> Iterator[tuple[Path, Mapping[str, Any]]]:
    """The yaml of every clip, and its truth.

    Args:
      folder: of the clips.
      only: how their names begin.
      effect: that is in the truth; "all": any.

    Raises:
      InputError: there is none.
    """
    paths = [path for path in sorted(folder.glob("*.truth.json")) if fnmatch(path.name, f"{only}*")]
    truths = {path: json.loads(path.read_text()) for path in paths}
    chosen = [path for path in paths if effect in ("all", truths[path]["effect"])]
    if not chosen:
        raise InputError(f"{folder}: no *.truth.json there of set {effect}, {only}")
    for path in chosen:
        yield path.with_name(path.name.replace(".truth.json", ".yaml")), truths[path]


def scored(result: Mapping[str, Any], truth: Mapping[str, Any]) -> dict[str, scoring.Score]:
    """The scores of a fit, by what the truth says that the clip can tell."""
    events, path = truth["events_s"], truth["trajectory"]["object1"]
    travel_m = float(np.hypot(path["y"][-1] - path["y"][0], path["z"][-1] - path["z"][0]))
    moves = events["foot"] is not None or travel_m > 0.01
    return scoring.score(scoring.of_result(result), truth, events["hit"] is not None, moves)
