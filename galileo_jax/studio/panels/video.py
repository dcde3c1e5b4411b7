"""Video: which clip, or which trials; its frame rate, and from which frame on it counts."""

from collections.abc import Callable
from functools import partial

from nicegui import ui

from galileo_jax.studio.panels import parts
from galileo_jax.studio.tab import Tab


def build(tab: Tab) -> None:
    """The panel."""
    session = tab.session
    parts.title("Video")
    for name, problem in session.broken.items():
        ui.label(f"{name}: {problem}").classes("trouble")
    if not session.names:
        ui.label(f"No video in {session.root}.").classes("soft")
        return
    _clips(tab)
    if (sheet := session.sheet) is None:
        return
    info, marks = sheet.info, sheet.marks
    ui.label(
        f"{sheet.source.name}: {info.frame_count} frames, {info.size_px[0]} x {info.size_px[1]}"
    ).classes("soft")
    with parts.row():
        parts.number_field(
            "true frames per second", marks.fps,
            lambda value: tab.change(fps=value) if value else None, "data-fps step=any", min=1,
        )  # fmt: skip
    end = info.frame_count - 1

    def begin(frame: float | None) -> None:
        tab.change(first_frame=int(frame or 0))

    def stop(frame: float | None) -> None:
        is_last = frame is None or int(frame) == end
        tab.change(last_frame=None if is_last else int(frame or 0))

    last = end if marks.last_frame is None else marks.last_frame
    _frame(tab, "counts from frame", marks.first_frame, begin, "data-first", "from-here")
    _frame(tab, "counts to frame", last, stop, "data-last", "to-here")
    for one in sheet.remarks:
        if "frame" in one.sentence:
            parts.remark(one.kind, one.sentence)
    for warning in info.warnings:
        parts.remark("odd", warning.split(": ", 1)[-1])
    parts.main_button("Mark", lambda: tab.go("marks"), tab, "to-marks")


def _frame(
    tab: Tab, label: str, value: int, action: Callable[[float | None], None], mark: str, here: str
) -> None:
    """A field of a frame's number, and a button for the one that is shown."""
    with parts.row():
        parts.number_field(label, value, action, mark, min=0, precision=0).style("width: 150px")
        parts.plain_button("this frame", lambda: action(tab.frame), here)


def _clips(tab: Tab) -> None:
    session = tab.session
    if len(session.names) == 1:
        return
    ui.label("Clips; those that are ticked are trials of the same objects").classes("small soft")
    for name in session.names:
        with parts.row(is_one_line=True):
            box = ui.checkbox(value=name in session.chosen)
            box.props(f'data-trial="{name}" aria-label="{name} is a trial"')
            box.on_value_change(lambda event, name=name: _tick(tab, name, bool(event.value)))
            look = ui.button(name, on_click=partial(session.show, name), color=None)
            look.props(f'flat no-caps data-clip="{name}"')
            look.classes("main" if name == session.active else "plain")


def _tick(tab: Tab, name: str, is_on: bool) -> None:
    chosen = set(tab.session.chosen)
    tab.session.choose(tuple(chosen | {name} if is_on else chosen - {name}))
