"""What commands have left to be shown: answers in a yaml, the paragraph, page and picture."""

from collections.abc import Collection, Mapping
from pathlib import Path
from typing import Any

from galileo_jax.studio.clip_state import Sheet, Table
from galileo_jax.studio.results import alone
from galileo_jax.studio.stages import Trials, changed_at, made
from galileo_jax.studio.store import Store


def answered(trials: Trials, store: Store) -> tuple[Sheet | Table, ...]:
    """The clips whose yaml is what was written with a person's answers."""
    return tuple(
        sheet
        for sheet in trials.sheets
        if (text := store.get("clips", sheet.name).get("answered"))
        and sheet.yaml.is_file()
        and sheet.yaml.read_text(encoding="utf-8") == text
    )


def remember_answers(trials: Trials, store: Store, undeclared: Collection[str]) -> None:
    """Remembers what was written beside clips that had no yaml."""
    for sheet in trials.sheets:
        if sheet.name in undeclared and sheet.yaml.is_file():
            text = sheet.yaml.read_text(encoding="utf-8")
            known = store.get("clips", sheet.name)
            store.put("clips", sheet.name, known | {"answered": text})


def entry(trials: Trials, found: Mapping[str, Any]) -> dict[str, Any]:
    """What the store keeps of a run that was explained.

    The comparison is of the model without effects: with some it is out of date.
    """
    fitted = made(trials.file("fit"), trials.made_of())
    kept: dict[str, Any] = {
        "fit": fitted,
        "explained": {**fitted, "paragraph": found["paragraph"], "notes": found["notes"]},
        "compare": made(trials.file("compare"), trials.made_of(())),
        "compare_view": found["compare"],
    }
    if found["diagnosis"] is not None:
        kept["diagnose"] = made(trials.file("diagnose"), trials.made_of())
        kept["diagnose_view"] = found["diagnosis"]
    return kept


def told(trials: Trials, entry: Mapping[str, Any]) -> dict[str, Any]:
    """The result in words with its notes; empty where the run is not the one that was explained."""
    found = entry.get("explained")
    if not found or found.get("at") != changed_at(trials.file("fit")):
        return {"paragraph": "", "notes": ()}
    return {"paragraph": str(found["paragraph"]), "notes": tuple(map(str, found["notes"]))}


def report(trials: Trials, name: str) -> str | None:
    """A clip's page, as one file; None: there is none."""
    path = trials.run / ("report.html" if len(trials.sheets) == 1 else f"report_{name}.html")
    return alone(path.read_text(encoding="utf-8")) if _is_inside(path, trials) else None


def still(trials: Trials, name: str) -> bytes | None:
    """The first and the last frame of a clip's prediction, PNG; None: there is none."""
    path = trials.run / ("" if len(trials.sheets) == 1 else name) / "first_and_last.png"
    return path.read_bytes() if _is_inside(path, trials) else None


def _is_inside(path: Path, trials: Trials) -> bool:
    return path.is_file() and path.resolve().is_relative_to(trials.root)
