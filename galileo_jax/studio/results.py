"""What lies in a run's folder, as the page shows it, and what is added while a job runs.

Nothing in a folder is run or trusted.
"""

import csv
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from galileo_jax.clip.yaml_file import read_mapping
from galileo_jax.results.stale_outputs import document
from galileo_jax.runtime.errors import InputError
from galileo_jax.studio.paths import below, check_declared
from galileo_jax.studio.stages import Trials, changed_at, track_files

BESIDE = re.compile(r'<p><a href="[\w/.-]+\.html">[^<]*</a></p>\n')


@dataclass(frozen=True)
class Results:
    """Views of what was computed for the chosen clips; None: not there."""

    tracks: Mapping[str, Any]
    effects: tuple[str, ...] = ()  # of the fit that lies there
    paragraph: str = ""  # what `explain` says
    notes: tuple[str, ...] = ()  # that go with it
    fit: Mapping[str, Any] | None = None
    live: Mapping[str, Any] | None = None  # the model at the sliders
    compare: Mapping[str, Any] | None = None
    diagnosis: Mapping[str, Any] | None = None  # diagnosis.json, with sentence and curves
    candidates: tuple[Mapping[str, Any], ...] = ()  # as they stream in
    previews: Mapping[str, Any] = field(default_factory=dict)  # their curves, until all are there
    rounds: tuple[Mapping[str, Any], ...] = ()
    prediction: Mapping[str, Any] | None = None


def with_partial(shown: Results, content: Mapping[str, Any]) -> Results:
    """What is shown when a job has said more."""
    ((kind, new), *_) = content.items()
    match kind:
        case "tracking":
            return _with_track(shown, _begun(new))
        case "frame":
            return _followed(shown, **new)
        case "track":
            return _with_track(shown, new)
        case "fit":
            return replace(shown, fit=new, live=None)
        case "explained":
            told = {"paragraph": new["paragraph"], "notes": tuple(new["notes"])}
            return replace(shown, **told, fit=new["fit"], live=None)
        case "compare":
            return replace(shown, compare=new)
        case "candidate":
            others = [one for one in shown.candidates if one["effect"] != new["effect"]]
            ranked = sorted([*others, new], key=lambda one: -float(one.get("score") or 0.0))
            previews = {**shown.previews, new["effect"]: content.get("curves", ())}
            return replace(shown, candidates=tuple(ranked), previews=previews)
        case "verdict":
            return replace(shown, diagnosis={**new["document"], "curves": new["curves"]})
    return shown


def _with_track(shown: Results, view: Mapping[str, Any]) -> Results:
    return replace(shown, tracks={**shown.tracks, view["clip"]: view})


def _begun(of: Mapping[str, Any]) -> dict[str, Any]:
    """The track of a clip in which no frame has been looked at yet."""
    empty = {"times": [], "seen_px": [[] for _ in of["objects"]], "sd_px": None, "warnings": []}
    return {**of, **empty, "is_running": True}


def _followed(shown: Results, index: int, places_px: Mapping[str, Any]) -> Results:
    """One frame more of the clip that is being tracked."""
    for view in shown.tracks.values():
        if view.get("is_running") and index == len(view["times"]):
            places = [list(places_px[name] or (None, None)) for name in view["objects"]]
            seen = [[*was, new] for was, new in zip(view["seen_px"], places, strict=True)]
            times = [*view["times"], index / view["fps"]]
            return _with_track(shown, {**view, "times": times, "seen_px": seen})
    return shown


def program_of(run: Path) -> str | None:
    """The file of effects that loading a run would run; None: there is none."""
    files = document(run / "result.json").get("effects_from")
    return str(files[0]) if isinstance(files, list) and files else None


def check_run(root: Path, run: Path, may_run: bool = False) -> None:
    """Refuses to open a run that leads out of the folder, or would run a file of effects.

    `may_run`: somebody has pressed the button for its effects, which lie in the folder.

    Raises:
      InputError: says why.
    """
    below(root, run)
    if (program := program_of(run)) is not None:
        below(root, program)
        if not may_run:
            raise InputError(
                f"{run.name}: its model has effects of {program}, which is a program; it is "
                "opened when you press for it"
            )
    for path in (run / "clip.yaml", *run.glob("*/clip.yaml")):
        if path.is_file():
            below(root, path)
            check_declared(root, path.parent, read_mapping(path))


def pixel_track(path: Path) -> dict[str, Any] | None:
    """A track in pixels that `galileo track` wrote; None where there is none."""
    try:
        with path.open(encoding="utf-8", newline="") as file:
            rows = list(csv.DictReader(file))
        names = [key.removesuffix("_x_px") for key in rows[0] if key.endswith("_x_px")]
        names = [name for name in names if not name.endswith("_sd")]
        pairs = {
            kind: [
                [[_number(row[f"{name}_{prefix}{axis}_px"]) for axis in "xy"] for row in rows]
                for name in names
            ]
            for kind, prefix in (("seen_px", ""), ("sd_px", "sd_"))
        }
        for places in pairs["seen_px"]:
            places[:] = [[None, None] if None in place else place for place in places]
        times = [float(row["time_s"]) for row in rows]
    except (OSError, KeyError, ValueError, IndexError, csv.Error):
        return None
    return {"clip": "", "objects": names, "times": times, "warnings": [], **pairs}


def round_of(result: Mapping[str, Any]) -> dict[str, Any]:
    """A round of the loop, from result.json."""
    error, known = result["error"], result["parameters"]
    frictions = {
        name: {key: known[name][key] for key in ("mean", "sd", "mcse") if key in known[name]}
        for name in ("k1", "k2")
        if name in known
    }
    keys = ("rmse", "noise", "chi2_per_dof")
    return {"effects": list(result["effects"]), **{k: error[k] for k in keys}, **frictions}


def with_round(rounds: Sequence[Mapping[str, Any]], new: Mapping[str, Any]) -> list[dict[str, Any]]:
    """The rounds with one more; those whose model is not a part of the new one's are over."""
    own = set(new["effects"])
    return [dict(one) for one in (*(r for r in rounds if set(r["effects"]) < own), new)]


def tracks(trials: Trials) -> dict[str, Any]:
    """Those that lie in the folder, by clip."""
    views = {one.name: pixel_track(track_files(one) / "track_px.csv") for one in trials.sheets}
    return {name: {**view, "clip": name} for name, view in views.items() if view is not None}


def stored(trials: Trials, entry: Mapping[str, Any]) -> dict[str, Any]:
    """The fields of `Results` that lie in a run's folder, or in its entry of the store."""
    fitted, found = document(trials.file("fit")), document(trials.file("diagnose"))
    effects = fitted.get("effects")
    fit_at, asked_at = changed_at(trials.file("fit")), changed_at(trials.file("diagnose"))
    is_own = bool(found) and entry.get("diagnose", {}).get("at") == asked_at  # not a command's
    curves = entry.get("diagnose_view", {}).get("curves", {}) if is_own else {}
    explained = entry.get("explained") or {}
    is_explained = explained.get("at") == fit_at
    ahead = entry.get("predict_view", {})
    has_ahead = trials.file("predict").is_file() and "clips" in ahead
    return {
        "effects": tuple(map(str, effects)) if isinstance(effects, list) else (),
        "paragraph": str(explained["paragraph"]) if is_explained else "",
        "notes": tuple(map(str, explained["notes"])) if is_explained else (),
        "compare": entry.get("compare_view") if trials.file("compare").is_file() else None,
        "prediction": ahead if has_ahead else None,
        "diagnosis": {"sentence": "", **found, "curves": curves} if found else None,
        "candidates": tuple(found.get("candidates", ())),
        "rounds": tuple(_rounds(entry.get("rounds") or list(found.get("history", ())), fitted)),
    }


def _rounds(known: list[dict[str, Any]], fitted: Mapping[str, Any]) -> list[dict[str, Any]]:
    """With that of the fit that lies there, whoever made it."""
    try:
        last = round_of(fitted)
    except (KeyError, TypeError):
        return known
    is_last = bool(known) and set(known[-1]["effects"]) == set(last["effects"])
    return known if is_last else with_round(known, last)


def kept_page(trials: Trials, name: str) -> str | None:
    """A clip's page, as one file to be kept; None: there is none."""
    path = _own(trials, name, "report.html" if len(trials.sheets) == 1 else f"report_{name}.html")
    return None if path is None else alone(path.read_text(encoding="utf-8"))


def alone(page: str) -> str:
    """A page without the links to pages beside it."""
    return BESIDE.sub("", page)


def still(trials: Trials, name: str) -> bytes | None:
    """The first and the last frame of a clip's prediction, PNG; None: there is none."""
    folder = "." if len(trials.sheets) == 1 else name
    path = _own(trials, name, f"{folder}/first_and_last.png")
    return None if path is None else path.read_bytes()


def _own(trials: Trials, name: str, file: str) -> Path | None:
    """A file of the run, where the clip is one of its own and the file does not lead away."""
    path = trials.run / file
    is_clip = any(sheet.name == name for sheet in trials.sheets)
    is_there = is_clip and path.is_file() and path.resolve().is_relative_to(trials.root)
    return path if is_there else None


def _number(text: str) -> float | None:
    return float(text) if text else None
