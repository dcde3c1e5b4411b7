"""The summary of a sweep: one row for each cell, in the order of the config.

It holds nothing of when and where a cell was computed, so that a sweep that was killed and
taken up again ends with the same table, to the last digit.
"""

import contextlib
from collections.abc import Iterable, Mapping, Sequence
from functools import cache
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from galileo_jax.files.tables import TABLE_FORMATS, write_table
from galileo_jax.report.sweep_clips import verdict_words
from galileo_jax.results.shown import headlines, point_estimate
from galileo_jax.results.truth import hidden_effect, true_parameters
from galileo_jax.runtime.errors import InputError
from galileo_jax.sweeping.cell import Cell
from galileo_jax.sweeping.settings import Diagnose, Explain
from galileo_jax.sweeping.store import Store
from galileo_jax.sweeping.work import CHECK, MISSING

QUANTITIES = ("k1", "k2", "mass_ratio")  # have columns in every summary
ERRORS = ("rmse", "noise", "chi2_per_dof", "rms_mm", "rms_percent_of_way", "frames_used", "frames")
NONE = "none"  # no effect: in the model, hidden, or found
OF_QUANTITY = ("", "_sd", "_q025", "_q975", "_unit", "_identified", "_true", "_error", "_covered")
COLUMNS = (
    *("cell", "clips", "method", "options", "effects", "seed", "hidden"),
    *("status", "failure", "converged", "verdict", "effect", "adequate", "p_value"),
    *("outside", "remark"),
    *(f"{quantity}{column}" for quantity in QUANTITIES for column in OF_QUANTITY),
    *ERRORS,
)
Row = dict[str, Any]


def make_rows(cells: Iterable[Cell], store: Store) -> list[Row]:
    """One row for each cell, keys as in `COLUMNS`; None where there is nothing to say.

    What a motion determines beside `QUANTITIES` (g, a stiffness, ...) follows with such keys.
    """
    truth_of = cache(read_truth)
    return [_row(cell, store, truth_of(cell.clips[0].path)) for cell in cells]


def read_truth(clip: Path) -> dict[str, Any]:
    """What NAME.truth.json beside a clip says of friction, masses and effect; {} without.

    It is shown beside what was found, and nothing else is done with it; one that is damaged
    counts as none.
    """
    with contextlib.suppress(InputError):
        return {**true_parameters(clip), "hidden": hidden_effect(clip)}
    return {}


def write_tables(folder: Path, rows: Sequence[Row]) -> list[Path]:
    """Writes summary.csv and, where pyarrow is installed, summary.parquet; returns the files."""
    import pandas as pd

    table = pd.DataFrame(list(rows), columns=columns_of(rows))
    formats = [name for name in TABLE_FORMATS if name == "csv" or find_spec("pyarrow")]
    paths = [folder / f"summary.{name}" for name in formats]
    for path in paths:
        write_table(path, table)
    return paths


def columns_of(rows: Sequence[Row]) -> list[str]:
    """`COLUMNS`, and those of what only these rows have."""
    return list(dict.fromkeys([*COLUMNS, *(key for row in rows for key in row)]))


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
    row |= {"status": "done"} | found(result, truth)
    if isinstance(cell.settings, Explain):
        row |= _of_check(result, store.result(cell.name, CHECK), store.result(cell.name, MISSING))
    return row


def _of_check(result: dict[str, Any], check: dict[str, Any], missing: dict[str, Any]) -> Row:
    """What an explanation says beside its fit."""
    row: Row = {key: check[key] for key in ("adequate", "p_value")}
    row |= {"effects": "+".join(result["effects"]) or NONE, "remark": result.get("no_verdict")}
    status = {"verdict": {"status": NONE, "effects": []}} if check["adequate"] else {}
    return row | _of_verdict(missing or status)


def _of_verdict(diagnosis: dict[str, Any]) -> Row:
    """One word for the confusion matrix, the effects named or the status; and the page's words."""
    if not diagnosis:
        return {}
    verdict = diagnosis["verdict"]
    named = "+".join(verdict["effects"])
    word = named if verdict["status"] == "named" else verdict["status"]
    return {"verdict": word, "effect": verdict_words(verdict)}


def _of_fit(result: dict[str, Any], truth: dict[str, Any]) -> Row:
    entries = result["parameters"] | result["derived"]
    best = point_estimate(result)
    row: Row = {"converged": result["converged"]}
    for name, entry in headlines(entries).items():
        row |= _of_quantity(name, entry, best.get(name), truth.get(name))
    return row | {key: result["error"].get(key) for key in ERRORS}


def _of_quantity(
    name: str, entry: Mapping[str, Any], best: float | None, true: float | None
) -> Row:
    value = entry["mean"] if best is None else best
    row: Row = {name: value}
    if best is None:
        row |= {f"{name}_{key}": entry[key] for key in ("sd", "q025", "q975", "unit", "identified")}
    if true is not None:
        row |= {f"{name}_true": true, f"{name}_error": value - true}
        if best is None:
            row[f"{name}_covered"] = entry["q025"] <= true <= entry["q975"]
    return row


def _of_diagnosis(result: dict[str, Any], truth: dict[str, Any]) -> Row:
    last = result["history"][-1]
    row: Row = {
        **_of_verdict(result),
        "adequate": result["adequate"],
        "p_value": result["p_value"],
        "effects": "+".join(last["effects"]) or NONE,
        **{key: last.get(key) for key in ERRORS},
    }
    for name in QUANTITIES:
        if name in last:
            row |= _of_quantity(name, last[name], None, truth.get(name))
    return row
