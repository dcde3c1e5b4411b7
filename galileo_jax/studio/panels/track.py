"""Track: where the objects were, drawn over the video, with errors and gaps."""

from collections.abc import Mapping
from functools import partial
from typing import Any

from nicegui import ui

from galileo_jax.studio.marks import Marks, corrected
from galileo_jax.studio.panels import parts
from galileo_jax.studio.tab import Tab


def build(tab: Tab) -> None:
    """The panel."""
    session = tab.session
    parts.title("Track")
    track = session.results.tracks.get(session.active)
    if track is None:
        ui.label("The program follows every object through the video.").classes("soft")
    elif track.get("is_running"):
        ui.label("Following every object, frame by frame.").classes("soft")
        return
    else:
        _found(track)
        if session.sheet is not None:
            _put_right(tab, session.sheet.marks)
    state = session.states["track"]
    if state != "done":
        text = "Track again" if state == "stale" else "Track"
        parts.main_button(text, session.track, tab, "track")
    elif session.states["fit"] in ("open", "stale"):
        parts.main_button("Fit", lambda: tab.go_on("fit", session.fit), tab, "fit")
        parts.plain_button("Track again", session.track, "again", tab)
    else:
        parts.main_button("Fit", lambda: tab.go("fit"), tab, "to-fit")


def _found(track: Mapping[str, Any]) -> None:
    """What to know of every object's track."""
    frames = len(track["times"])
    for name, places, errors in zip(
        track["objects"], track["seen_px"], track["sd_px"], strict=True
    ):
        seen = [i for i, place in enumerate(places) if place[0] is not None]
        if not seen:
            parts.remark("missing", f"{name} was not seen in any frame.")
            continue
        sd = sorted(max(errors[i]) for i in seen)[len(seen) // 2]
        kind = "fine" if len(seen) > 0.9 * frames else "odd"
        parts.remark(kind, f"{name}: seen in {len(seen)} of {frames} frames, to {sd:.2f} px.")
    for warning in track["warnings"]:
        parts.remark("odd", warning)


def _put_right(tab: Tab, marks: Marks) -> None:
    """A lost object: go to the first wrong frame, click on it, and it is followed from there."""
    if tab.placing:
        ui.label(f"Click on the middle of {tab.placing} in the video.").classes("say")
        parts.plain_button("Never mind", lambda: tab.place(""), "place-none")
        return
    ui.label("If a path leaves its object, go to the first wrong frame:").classes("soft small")
    with parts.row():
        for name in (one.name for one in marks.objects):
            lost = partial(tab.place, name)
            parts.plain_button(f"{name} is lost here", lost, f"right-{name}", tab)
    for one in marks.objects:
        for frame, _, _ in one.corrections:
            with parts.row():
                ui.label(f"{one.name} was corrected in frame {frame}").classes("soft")
                back = partial(tab.edit, corrected, one.name, frame, None)
                parts.icon_button("close", f"Take back frame {frame} of {one.name}", back)
