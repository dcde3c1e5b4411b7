"""The summary of a sweep: one row for each cell, in the order of the config.

It holds nothing of when and where a cell was computed, so that a sweep that was killed and
taken up again ends with the same table, to the last digit.
"""

import json
from collections.abc import Iterable, Sequence
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from galileo_jax.files.tables import TABLE_FORMATS, write_table
from galileo_jax.results.shown_parameters import point_estimate
from galileo_jax.sweeping.cell import Cell
from galileo_jax.sweeping.settings import Diagnose
from galileo_jax.sweeping.store import Store

QUANTITIES = ("k1", "k2", "mass_ratio")
NONE = "none"  # no effect: in the model, hidden, or found
OF_QUANTITY = ("", "_sd", "_q025", "_q975", "_identified", "_true", "_error", "_covered")
COLUMNS = (
    *("cell", "clips", "method", "options", "effects", "seed", "hidden"),
    *("status", "failure", "converged", "verdict", "adequate", "p_value"),
    *(f"{quantity}{column}" for quantity in QUANTITIES for column in OF_QUANTITY),
    *("rmse", "noise", "chi2_per_dof"),
)
Row = dict[str, Any]


def make_rows(cells: Iterable[Cell], store: Store) -> list[Row]:
    """One row for each cell, keys as in `COLUMNS`; None where there is nothing to say."""
    truths: dict[Path, dict[str, Any]] = {}
    rows = []
    for cell in cells:
        path = cell.clips[0].path
        if path not in truths:
            truths[path] = read_truth(path)
        rows.append(_row(cell, store, truths[path]))
    return rows


def read_truth(clip: Path) -> dict[str, Any]:
    """What NAME.truth.json beside a clip says of friction, masses and effect; {} without.

    It is shown beside what was found, and nothing else is done with it; one that is damaged
    counts as none.
    """
    try:
        content = json.loads(clip.with_suffix(".truth.json").read_text(encoding="utf-8"))
        truth = {key: float(content[key]) for key in ("k1", "k2")}
        truth["mass_ratio"] = float(content["m1"]) / float(content["m2"])
        return truth | {"hidden": str(content.get("effect", NONE))}
    except (OSError, ValueError, KeyError, TypeError, ZeroDivisionError):
        return {}


def write_tables(folder: Path, rows: Sequence[Row]) -> list[Path]:
    """Writes summary.csv and, where pyarrow is installed, summary.parquet; returns the files."""
    import pandas as pd

    table = pd.DataFrame(list(rows), columns=list(COLUMNS))
    formats = [name for name in TABLE_FORMATS if name == "csv" or find_spec("pyarrow")]
    paths = [folder / f"summary.{name}" for name in formats]
    for path in paths:
        write_table(path, table)
    return paths


def _row(cell: Cell, store: Store, truth: dict[str, Any]) -> Row:
    settings = cell.settings.model_dump(mode="json")
    shown = {"method": settings.pop("method"), "seed": settings.pop("seed")}
    effects = settings.pop("effects", [])
    row: Row = dict.fromkeys(COLUMNS) | {
        "cell": cell.name,
        "clips": " ".join(str(clip.path) for clip in cell.clips),
        **shown,
        "options": " ".join(f"{key}={value}" for key, value in settings.items()),
        "effects": "+".join(effects) or NONE,
        "hidden": truth.get("hidden"),
        "status": "missing",
    }
    if (failure := store.failure(cell.name)) is not None:
        return row | {"status": "failed", "failure": failure.line}
    if not store.has_result(cell.name):
        return row
    result = store.result(cell.name)
    found = _of_diagnosis if isinstance(cell.settings, Diagnose) else _of_fit
    return row | {"status": "done"} | found(result, truth)


def _of_fit(result: dict[str, Any], truth: dict[str, Any]) -> Row:
    entries = result["parameters"] | result["derived"]
    best = point_estimate(result)
    row: Row = {"converged": result["converged"]}
    for name in QUANTITIES:
        if name in entries:
            row |= _of_quantity(name, entries[name], best.get(name), truth.get(name))
    return row | {key: result["error"][key] for key in ("rmse", "noise", "chi2_per_dof")}


def _of_quantity(name: str, entry: dict[str, Any], best: float | None, true: float | None) -> Row:
    value = entry["mean"] if best is None else best
    row: Row = {name: value}
    if best is None:
        row |= {f"{name}_{key}": entry[key] for key in ("sd", "q025", "q975", "identified")}
    if true is not None:
        row |= {f"{name}_true": true, f"{name}_error": value - true}
        if best is None:
            row[f"{name}_covered"] = entry["q025"] <= true <= entry["q975"]
    return row


def _of_diagnosis(result: dict[str, Any], truth: dict[str, Any]) -> Row:
    last = result["history"][-1]
    row: Row = {
        "verdict": _verdict(result["verdict"]),
        "adequate": result["adequate"],
        "p_value": result["p_value"],
        "effects": "+".join(last["effects"]) or NONE,
        **{key: last[key] for key in ("rmse", "noise", "chi2_per_dof")},
    }
    for name in QUANTITIES:
        if name in last:
            row |= _of_quantity(name, last[name], None, truth.get(name))
    return row


def _verdict(verdict: dict[str, Any]) -> str:
    """One word for the confusion matrix: the effects named, or the status."""
    return "+".join(verdict["effects"]) if verdict["status"] == "named" else verdict["status"]
