"""The stages: which are done, which are out of date, which wait for another."""

from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

from galileo_jax.results.run import RESULT
from galileo_jax.results.stale_outputs import DOCUMENTS, PREDICTION
from galileo_jax.studio.clip_state import Sheet, Table
from galileo_jax.studio.store import Store, fingerprint, yaml_content

State = Literal["locked", "open", "done", "stale"]

STAGES = {
    "explain": "Explain",
    "video": "Video",
    "marks": "Marks",
    "track": "Track",
    "fit": "Fit",
    "compare": "Where it fails",
    "diagnose": "What is missing",
    "predict": "Predict",
}
FILES = {"fit": RESULT, **DOCUMENTS, "predict": PREDICTION}


@dataclass(frozen=True)
class Trials:
    """The clips that are fitted together, and where their results lie."""

    root: Path
    sheets: tuple[Sheet | Table, ...]

    @property
    def name(self) -> str:
        """Of the run, as the commands name it."""
        return "+".join(sheet.name for sheet in self.sheets)

    @property
    def run(self) -> Path:
        """The folder of the run."""
        return self.root / "runs" / self.name

    def file(self, stage: str) -> Path:
        """What a stage leaves; of several clips each has its own prediction."""
        folder = self.run
        if stage == "predict" and len(self.sheets) > 1:
            folder = self.run / next(iter(self.sheets)).name
        return folder / FILES[stage]

    @property
    def files(self) -> list[str]:
        """The clips as a command is given them, in the folder."""
        return [sheet.source.name for sheet in self.sheets]

    def made_of(self, *more: Any) -> str:
        """What tells results of these marks from those of others."""
        return fingerprint([yaml_content(sheet.yaml) for sheet in self.sheets], *more)


def track_files(sheet: Sheet | Table) -> Path:
    """The folder that `galileo track` writes by default."""
    return sheet.root / f"{sheet.name}_track"


def states(trials: Trials, store: Store, effects: tuple[str, ...]) -> dict[str, State]:
    """The state of every stage, from the files that are there.

    A result without an entry in the store, of a command, is up to date where it is younger than
    the yaml.
    """
    found: dict[str, State] = dict.fromkeys(STAGES, "locked")
    found |= {"explain": "open", "video": "done" if trials.sheets else "open"}
    if not trials.sheets:
        return found
    is_complete = all(sheet.is_complete for sheet in trials.sheets)
    marks, model = (trials.made_of(), trials.made_of(effects)) if is_complete else ("", "")
    entry = store.get("runs", trials.name)
    fit = _state(trials, "fit", entry, marks)
    found["marks"] = "done" if is_complete else "open"
    if entry.get("explained", {}).get("at") == changed_at(trials.file("fit")):
        found["explain"] = fit
    if is_complete:
        tracked = {_track_state(sheet, store) for sheet in trials.sheets}
        found["track"] = "open" if "open" in tracked else "stale" if "stale" in tracked else "done"
    if found["track"] == "done" or fit in ("done", "stale"):
        found["fit"] = fit
    if found["fit"] in ("done", "stale"):
        for stage, of in (("compare", model), ("diagnose", marks), ("predict", model)):
            state = _state(trials, stage, entry, of)
            is_of_older = fit == "stale" and state == "done" and stage != "diagnose"
            found[stage] = "stale" if is_of_older else state
    return found


def track_mark(sheet: Sheet | Table) -> str:
    """What a track was made of."""
    return fingerprint(yaml_content(sheet.yaml))


def changed_at(path: Path) -> int:
    """When a file was written; 0 where it is not there."""
    return path.stat().st_mtime_ns if path.is_file() else 0


def _track_state(sheet: Sheet | Table, store: Store) -> State:
    if isinstance(sheet, Table):
        return "done"
    made = store.get("clips", sheet.name).get("tracked")
    return _fresh(track_files(sheet) / "track_px.csv", made, track_mark(sheet), (sheet.yaml,))


def _state(trials: Trials, stage: str, entry: dict[str, Any], now: str) -> State:
    sources = [sheet.yaml for sheet in trials.sheets]
    if stage in ("compare", "predict"):
        sources.append(trials.run / FILES["fit"])
    return _fresh(trials.file(stage), entry.get(stage), now, sources)


def _fresh(path: Path, made: Any, now: str, sources: Iterable[Path]) -> State:
    """Of a file by its entry in the store, else by its age beside that of its sources."""
    if not (at := changed_at(path)):
        return "open"
    if isinstance(made, dict) and made.get("at") == at:
        return "done" if made.get("of") == now else "stale"
    return "done" if at >= max(map(changed_at, sources), default=0) else "stale"


def made(path: Path, of: str) -> dict[str, Any]:
    """An entry of the store: this file was made of that."""
    return {"of": of, "at": path.stat().st_mtime_ns}
