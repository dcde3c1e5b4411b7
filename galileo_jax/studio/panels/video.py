"""Video: which clip, or which trials; its frame rate, and from which frame on it counts."""

from functools import partial
from typing import TYPE_CHECKING

from nicegui import ui

from galileo_jax.studio.panels.parts import main_button, on_number, plain_button, remark, title

if TYPE_CHECKING:
    from galileo_jax.studio.page import Tab


def build(tab: "Tab") -> None:
    """The panel."""
    session = tab.session
    title("Video")
    for name, problem in session.broken.items():
        ui.label(f"{name}: {problem}").classes("trouble")
    if not session.names:
        ui.label(f"No video in {session.root}.").classes("soft")
        return
    _clips(tab)
    sheet = session.sheet
    if sheet is None:
        return
    info = sheet.info
    ui.label(
        f"{sheet.source.name}: {info.frame_count} frames, {info.size_px[0]} x {info.size_px[1]}"
    ).classes("soft")
    with ui.element("div").classes("rowline"):
        rate = ui.number("true frames per second", value=sheet.marks.fps, min=1)
        rate.props("outlined dense data-fps step=any")
        on_number(rate, lambda value: tab.change(fps=value) if value else None)
    with ui.element("div").classes("rowline"):
        first = ui.number("counts from frame", value=sheet.marks.first_frame, min=0, precision=0)
        first.props("outlined dense data-first").style("width: 150px")
        on_number(first, lambda value: tab.change(first_frame=int(value or 0)))
        plain_button("this frame", lambda: tab.change(first_frame=tab.frame), "from-here")
    with ui.element("div").classes("rowline"):
        end = info.frame_count - 1
        shown = end if sheet.marks.last_frame is None else sheet.marks.last_frame
        last = ui.number("counts to frame", value=shown, min=0, precision=0)
        last.props("outlined dense data-last").style("width: 150px")
        on_number(last, lambda value: _to(tab, value))
        plain_button("this frame", lambda: _to(tab, tab.frame), "to-here")
    for one in sheet.remarks:
        if "frame" in one.sentence:
            remark(one.kind, one.sentence)
    for warning in info.warnings:
        remark("odd", warning.split(": ", 1)[-1])
    main_button("Mark", lambda: tab.go("marks"), tab, "to-marks")


def _clips(tab: "Tab") -> None:
    session = tab.session
    names = session.names
    if len(names) == 1:
        return
    ui.label("Clips; those that are ticked are trials of the same objects").classes("small soft")
    for name in names:
        with ui.element("div").classes("rowline").style("flex-wrap: nowrap"):
            box = ui.checkbox(value=name in session.chosen).props(
                f'data-trial="{name}" aria-label="{name} is a trial"'
            )
            box.on_value_change(lambda event, name=name: _tick(tab, name, bool(event.value)))
            ui.button(name, on_click=partial(session.show, name), color=None).props(
                f'flat no-caps data-clip="{name}"'
            ).classes("main" if name == session.active else "plain")


def _tick(tab: "Tab", name: str, is_on: bool) -> None:
    session = tab.session
    names = {*session.chosen, name} if is_on else {one for one in session.chosen if one != name}
    session.choose(tuple(names))


def _to(tab: "Tab", frame: float | None) -> None:
    """The last frame that counts; the clip's own where none is given."""
    sheet = tab.session.sheet
    if sheet is not None:
        is_last = frame is None or int(frame) == sheet.info.frame_count - 1
        tab.change(last_frame=None if is_last else int(frame or 0))
