"""How well clips with known truth are fitted: `python benchmarks/accuracy.py FOLDER`.

Every NAME.yaml of FOLDER with a NAME.truth.json goes through all steps of `galileo fit`,
tracking and report included, in this process. Where the truth says that nothing can be told
(object 2 never hit, nothing moves), the fit has to say so, too. The mass ratio's errors are
relative. The last line is JSON.
"""

import argparse
import json
import time
from collections.abc import Mapping, Sequence
from fnmatch import fnmatch
from pathlib import Path
from typing import Any

import numpy as np
import scoring
import tables

from galileo_jax.api.fit import fit
from galileo_jax.commands import command
from galileo_jax.runtime.errors import InputError

BARS = {
    "k1": {"median": 0.003, "worst": 0.01},
    "k2": {"median": 0.01},
    "mass_ratio": {"median": 0.05, "worst": 0.15},
}
COVERAGE, CHI2 = 0.85, (0.7, 1.5)
COLUMNS = (
    *("k1 err", "z", "in 95%", "k2 err", "z", "in 95%", "ratio err", "z", "in 95%"),
    *("chi2/dof", "noise", "converged", "seconds"),
)


def main(argv: Sequence[str]) -> int | None:
    call = _parser().parse_args(argv)
    paths = [path for path in sorted(call.folder.glob("*.truth.json")) if _is_wanted(path, call)]
    if not paths:
        raise InputError(f"{call.folder}: no *.truth.json there of set {call.set}, {call.only}")
    tables.row("clip", COLUMNS)
    scores, chi2, seconds, failures = [], [], [], {}
    for path in paths:
        name, truth = path.name.removesuffix(".truth.json"), json.loads(path.read_text())
        began = time.perf_counter()
        try:
            result = _fit(path.with_name(f"{name}.yaml"), call)
        except InputError as error:
            failures[name] = str(error)
            print(f"{name:<28} {error}", flush=True)
            continue
        seconds.append(time.perf_counter() - began)
        events = truth["events_s"]
        moves = events["foot"] is not None or _travel_m(truth) > 0.01
        found = scoring.score(scoring.of_result(result), truth, events["hit"] is not None, moves)
        scores.append(found)
        chi2.append(result["error"]["chi2_per_dof"])
        cells: list[Any] = []
        for entry in found.values():
            cells += _cells(entry)
        noise = result["nuisances"]["noise_scale"]["mean"]
        tables.row(name, [*cells, chi2[-1], noise, result["converged"], seconds[-1]])
    if not scores:
        raise InputError(f"{call.folder}: no clip could be fitted")
    table = scoring.summary(scores)
    inside = float(np.mean([CHI2[0] <= value <= CHI2[1] for value in chi2]))
    print()
    tables.row("quantity", list(next(iter(table.values()))))
    for name, entry in table.items():
        tables.row(name, list(entry.values()))
    missed = _missed_bars(table, inside)
    print("bars missed: " + ("; ".join(missed) or "none"))
    tables.finish(
        "accuracy",
        {
            "method": call.method,
            "clips": len(paths),
            "failures": failures,
            **table,
            "chi2_per_dof": chi2,
            "seconds_median": float(np.median(seconds)),
            "seconds_worst": max(seconds),
            "bars_missed": missed,
        },
    )
    return None


def _fit(path: Path, call: argparse.Namespace) -> Mapping[str, Any]:
    """As the command does it."""
    return fit(path, method=call.method, seed=call.seed).result


def _cells(entry: scoring.Score) -> list[Any]:
    """Error, z and coverage; a verdict where one of the two says that nothing can be told."""
    if entry.is_scored:
        return [entry.error, entry.z, entry.is_covered]
    if entry.is_expected:
        return ["MISSED", entry.z, entry.is_covered]
    return ["CLAIMED" if entry.is_identified else "not told", None, None]


def _missed_bars(table: dict[str, dict[str, Any]], chi2_inside: float) -> list[str]:
    missed = []
    for name, bars in BARS.items():
        for what, bar in bars.items():
            if table[name][what] > bar:
                missed.append(f"{name} {what} {table[name][what]:.4g} > {bar:g}")
        if table[name]["coverage"] < COVERAGE:
            missed.append(f"{name} coverage {table[name]['coverage']:.2f} < {COVERAGE:g}")
        for what in ("missed", "claimed"):
            if table[name][what]:
                missed.append(f"{name} wrongly {what} in {table[name][what]}")
    if chi2_inside < 1:
        missed.append(f"chi2/dof outside {CHI2} in {1 - chi2_inside:.0%}")
    return missed


def _travel_m(truth: dict[str, Any]) -> float:
    path = truth["trajectory"]["object1"]
    return float(np.hypot(path["y"][-1] - path["y"][0], path["z"][-1] - path["z"][0]))


def _is_wanted(path: Path, call: argparse.Namespace) -> bool:
    effect = json.loads(path.read_text())["effect"]
    return (call.set == "all" or effect == call.set) and fnmatch(path.name, f"{call.only}*")


def _parser() -> command.Parser:
    parser = command.Parser(prog="accuracy.py", description=__doc__)
    parser.formatter_class = argparse.RawDescriptionHelpFormatter
    parser.add_argument("folder", type=Path)
    parser.add_argument("--method", choices=("grad", "mh"), default="grad")
    parser.add_argument("--only", default="*", help="glob over clip names")
    parser.add_argument("--set", default="none", help="an effect in the truth, or all")
    parser.add_argument("--seed", type=int, default=0)
    return parser


if __name__ == "__main__":
    raise SystemExit(command.run(main))
