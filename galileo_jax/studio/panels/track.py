"""Track: where the objects were, drawn over the video, with errors and gaps."""

from collections.abc import Mapping
from functools import partial
from typing import TYPE_CHECKING, Any

from nicegui import ui

from galileo_jax.studio.marks import Marks, corrected
from galileo_jax.studio.panels.parts import main_button, plain_button, remark, title

if TYPE_CHECKING:
    from galileo_jax.studio.page import Tab


def build(tab: "Tab") -> None:
    """The panel."""
    session = tab.session
    title("Track")
    track = session.results.tracks.get(session.active)
    state = session.states["track"]
    if track is None:
        ui.label("The program follows every object through the video.").classes("soft")
    elif track.get("is_running"):
        ui.label("Following every object, frame by frame.").classes("soft")
        return
    else:
        _found(track)
    if track is not None and session.sheet is not None:
        _put_right(tab, session.sheet.marks)
    if state != "done":
        main_button("Track again" if state == "stale" else "Track", session.track, tab, "track")
    elif session.states["fit"] in ("open", "stale"):
        main_button("Fit", lambda: _fit(tab), tab, "fit")
        plain_button("Track again", session.track, "again", session.job is None)
    else:
        main_button("Fit", lambda: tab.go("fit"), tab, "to-fit")


def _fit(tab: "Tab") -> None:
    tab.go("fit")
    tab.session.fit()


def _found(track: Mapping[str, Any]) -> None:
    """What to know of every object's track."""
    frames = len(track["times"])
    for name, places, errors in zip(
        track["objects"], track["seen_px"], track["sd_px"], strict=True
    ):
        seen = [i for i, place in enumerate(places) if place[0] is not None]
        if not seen:
            remark("missing", f"{name} was not seen in any frame.")
            continue
        sds = sorted(max(errors[i]) for i in seen)
        kind = "fine" if len(seen) > 0.9 * frames else "odd"
        remark(
            kind,
            f"{name}: seen in {len(seen)} of {frames} frames, to {sds[len(sds) // 2]:.2f} px.",
        )
    for warning in track["warnings"]:
        remark("odd", warning)


def _put_right(tab: "Tab", marks: Marks) -> None:
    """A lost object: go to the first wrong frame, click on it, and it is followed from there."""
    if tab.placing:
        ui.label(f"Click on the middle of {tab.placing} in the video.").classes("say")
        plain_button("Never mind", lambda: _place(tab, ""), "place-none")
        return
    ui.label("If a path leaves its object, go to the first wrong frame:").classes("soft small")
    with ui.element("div").classes("rowline"):
        for one in marks.objects:
            plain_button(
                f"{one.name} is lost here", partial(_place, tab, one.name), f"right-{one.name}",
                tab.session.job is None,
            )  # fmt: skip
    for one in marks.objects:
        for frame, _, _ in one.corrections:
            with ui.element("div").classes("rowline"):
                ui.label(f"{one.name} was corrected in frame {frame}").classes("soft")
                drop = ui.button(icon="close", color=None).props("flat round").classes("icon")
                drop.props(f'aria-label="Take back frame {frame} of {one.name}"')
                drop.on("click", partial(_take_back, tab, one.name, frame))


def _place(tab: "Tab", name: str) -> None:
    tab.placing = name
    tab.redraw()


def _take_back(tab: "Tab", name: str, frame: int) -> None:
    if tab.session.sheet is not None:
        tab.mark(corrected(tab.session.sheet.marks, name, frame, None))
