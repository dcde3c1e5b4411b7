"""Track: where the objects were, drawn over the video, with errors and gaps."""

from typing import TYPE_CHECKING

from nicegui import ui

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
    else:
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
            remark("odd", warning.split(": ", 1)[-1])
        ui.label(
            "If an object is lost: turn to Marks, move its mark, or let the clip count from a "
            "later frame."
        ).classes("soft small")
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
