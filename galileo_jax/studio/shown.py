"""What the page shows of results, and how it grows while they are computed."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any


@dataclass(frozen=True)
class Results:
    """Views of what was computed for the chosen clips; None: not there."""

    tracks: Mapping[str, Any]
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
