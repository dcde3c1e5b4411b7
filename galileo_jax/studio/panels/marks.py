"""Marks: everything in the first frame that the program must know, to be dragged; and `Check`."""

from dataclasses import replace
from typing import TYPE_CHECKING, Any

from nicegui import ui

from galileo_jax.clip.scenarios import SCENARIOS
from galileo_jax.clip.schema import SIZE_MEANING
from galileo_jax.studio.marks import ObjectMark, without_object
from galileo_jax.studio.panels.parts import (
    main_button,
    on_entered,
    on_number,
    plain_button,
    remark,
    title,
)

if TYPE_CHECKING:
    from galileo_jax.studio.page import Tab


def build(tab: "Tab") -> None:
    """The panel."""
    session = tab.session
    sheet = session.sheet
    if sheet is None:
        return
    title("Marks")
    marks = sheet.marks
    with ui.element("div").classes("rowline"):
        scene = ui.select(sorted(SCENARIOS), value=marks.scenario, label="scenario")
        scene.props("outlined dense options-dense").style("min-width: 130px")
        scene.on_value_change(lambda event: _mark(tab, scenario=event.value))
        stick = ui.number("stick, m", value=marks.stick_m, min=0, step="any")
        stick.props("outlined dense data-stick").style("width: 120px")
        on_number(stick, lambda value: _mark(tab, stick_m=value or None))
    for one in marks.objects:
        _object(tab, one)
    with ui.element("div").classes("rowline"):
        plain_button(
            "Click on the object" if tab.placing else "Add object",
            lambda: _place(tab),
            "add-object",
        )
        plain_button("Propose", lambda: _propose(tab), "propose", session.job is None)
    title("Check")
    for one in sheet.remarks:
        remark(one.kind, one.sentence)
    if sheet.is_complete:
        if all(one.kind != "missing" for one in sheet.remarks):
            remark("fine", "Nothing is missing: the clip can be tracked.")
        main_button("Track", lambda: _track(tab), tab, "track")


def _object(tab: "Tab", one: ObjectMark) -> None:
    with ui.element("div").classes("rowline").style("flex-wrap: nowrap"):
        ui.label(one.name).style("font-weight: 600; min-width: 68px")
        shape = ui.select(list(SIZE_MEANING), value=one.shape).props("outlined dense options-dense")
        shape.style("min-width: 104px")
        shape.on_value_change(lambda event: _change(tab, one, shape=event.value, size_m=None))
        shown = " ".join(f"{side:g}" for side in one.size_m or ())
        size = ui.input(label="size, m", value=shown, placeholder="if known")
        size.props(
            f'outlined dense title="{SIZE_MEANING[one.shape]}, m" data-size={one.name}'
        ).style("width: 140px")
        on_entered(size, lambda text: _size(tab, one, text))
        ui.button(icon="close", color=None, on_click=lambda: _drop(tab, one.name)).props(
            f'flat round aria-label="Remove {one.name}"'
        ).classes("icon")


def _size(tab: "Tab", one: ObjectMark, text: str) -> None:
    try:
        size = tuple(float(part) for part in text.replace(",", " ").split())
    except ValueError:
        tab.session.error = f"{one.name}: {text[:30]!r} is no size; metres expected"
        tab.redraw()
        return
    _change(tab, one, size_m=size or None)


def _change(tab: "Tab", one: ObjectMark, **given: Any) -> None:
    sheet = tab.session.sheet
    if sheet is not None:
        objects = tuple(
            replace(o, **given) if o.name == one.name else o for o in sheet.marks.objects
        )
        tab.mark(replace(sheet.marks, objects=objects))


def _drop(tab: "Tab", name: str) -> None:
    if tab.session.sheet is not None:
        tab.mark(without_object(tab.session.sheet.marks, name))


def _mark(tab: "Tab", **given: Any) -> None:
    if tab.session.sheet is not None:
        tab.mark(replace(tab.session.sheet.marks, **given))


def _place(tab: "Tab") -> None:
    tab.placing = not tab.placing
    tab.redraw()


def _propose(tab: "Tab") -> None:
    tab.session.propose()


def _track(tab: "Tab") -> None:
    tab.go("track")
    tab.session.track()
