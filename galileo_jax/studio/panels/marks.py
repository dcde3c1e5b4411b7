"""Marks: everything in the first frame that the program must know, to be dragged; and `Check`."""

from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING, Any

from nicegui import ui

from galileo_jax.clip.fields import SIZE_MEANING
from galileo_jax.clip.scenarios import SCENARIOS
from galileo_jax.studio.marks import (
    Marks,
    ObjectMark,
    with_rectangle,
    without_object,
)
from galileo_jax.studio.panels.parts import (
    main_button,
    on_entered,
    on_number,
    plain_button,
    remark,
    title,
)

NEW = "a new object"  # what a click into the video places

if TYPE_CHECKING:
    from galileo_jax.studio.page import Tab


def build(tab: "Tab") -> None:
    """The panel."""
    session = tab.session
    sheet = session.sheet
    title("Marks")
    if sheet is None:
        ui.label("A table has no pictures: what is declared stands in its yaml.").classes("soft")
        return
    marks = sheet.marks
    fields: dict[str, Any] = {}
    shown: dict[str, Any] = {}
    with ui.element("div").classes("rowline"):
        scene = ui.select(sorted(SCENARIOS), value=marks.scenario, label="scenario")
        scene.props("outlined dense options-dense").style("min-width: 130px")
        scene.on_value_change(lambda event: tab.change(scenario=event.value))
        lengths = _lengths(tab, marks)
        is_laid = marks.rectangle is not None
        text = "Ruler instead" if is_laid else "Rectangle instead"
        plain_button(text, lambda: _turn(tab, not is_laid), "rectangle")
    for one in marks.objects:
        fields[one.name] = _object(tab, one)
    with ui.element("div").classes("rowline"):
        text = "Click on the object" if tab.placing else "Add object"
        plain_button(text, lambda: _place(tab), "add-object")
        plain_button("Find objects", session.propose, "propose", session.job is None)
    title("Check")
    place = ui.element("div").style("display: contents")

    def refresh() -> None:
        """The rest of the panel stays, so that nothing is swept away while somebody types."""
        sheet = session.sheet
        if sheet is None:
            return
        for field, value in zip(lengths, _known(sheet.marks), strict=True):
            field.set_value(value)
        for one in sheet.marks.objects:
            fields[one.name].set_value(_text(one.size_m))
        now = (sheet.remarks, sheet.is_complete, session.job is None)
        if now == shown.get("check"):
            return  # a button that is about to be pressed stays where it is
        shown["check"] = now
        place.clear()
        with place:
            _check(tab)

    tab.refresh = refresh
    refresh()


def _lengths(tab: "Tab", marks: Marks) -> list[Any]:
    """The fields of what tells the scale."""

    def field(label: str, value: float | None, name: str, write: Any) -> Any:
        made = ui.number(label, value=value, min=0)
        made.props(f"outlined dense {name} step=any").style("width: 118px")
        on_number(made, write)
        return made

    if marks.rectangle is None:
        write = lambda value: tab.change(stick_m=value or None)  # noqa: E731
        return [field("ruler, m", marks.stick_m, "data-stick", write)]
    return [
        field(label, value, f"data-side={i}", partial(_side, tab, i))
        for i, (label, value) in enumerate(
            zip(("width, m", "height, m"), _known(marks), strict=True)
        )
    ]


def _known(marks: Marks) -> list[float | None]:
    if marks.rectangle is None:
        return [marks.stick_m]
    return [side or None for side in marks.rectangle_m]


def _side(tab: "Tab", which: int, value: float | None) -> None:
    if tab.session.sheet is not None:
        sides = list(tab.session.sheet.marks.rectangle_m)
        sides[which] = value or 0.0
        tab.change(rectangle_m=tuple(sides))


def _turn(tab: "Tab", to_rectangle: bool) -> None:
    sheet = tab.session.sheet
    if sheet is not None:
        marks = replace(sheet.marks, rectangle=None)
        tab.mark(with_rectangle(marks, sheet.info.size_px) if to_rectangle else marks)


def drawn(tab: "Tab") -> Any:
    """While this is the same, `Tab.refresh` is enough to show what has changed."""
    session, sheet = tab.session, tab.session.sheet
    if tab.stage != "marks" or sheet is None:
        return None
    objects = tuple((one.name, one.shape) for one in sheet.marks.objects)
    said = (session.error, session.note, session.job is None, session.chosen, session.active)
    return (sheet.marks.scenario, objects, sheet.marks.rectangle is None, tab.placing, said)


def _check(tab: "Tab") -> None:
    sheet = tab.session.sheet
    assert sheet is not None
    for one in sheet.remarks:
        remark(one.kind, one.sentence)
    if sheet.is_complete:
        remark("fine", "Everything is there: the clip can be tracked.")
        main_button("Track", lambda: _track(tab), tab, "track")


def _text(size: tuple[float, ...] | None) -> str:
    return " ".join(f"{side:g}" for side in size or ())


def _object(tab: "Tab", one: ObjectMark) -> Any:
    """A row of the list; returns the field of its size."""
    name = one.name
    with ui.element("div").classes("rowline").style("flex-wrap: nowrap"):
        ui.label(name).style("font-weight: 600; min-width: 68px")
        shape = ui.select(list(SIZE_MEANING), value=one.shape).props("outlined dense options-dense")
        shape.style("min-width: 96px")
        shape.on_value_change(lambda event: _change(tab, name, shape=event.value, size_m=None))
        size = ui.input(label="size, m", value=_text(one.size_m), placeholder="if known")
        meaning = f"{SIZE_MEANING[one.shape]}, m"
        size.props(f'outlined dense title="{meaning}" data-size={name}').style("flex: 1")
        on_entered(size, lambda text: _size(tab, name, text))
        drop = ui.button(icon="close", color=None, on_click=lambda: _drop(tab, name))
        drop.props(f'flat round aria-label="Remove {name}"').classes("icon")
    return size


def _size(tab: "Tab", name: str, text: str) -> None:
    try:
        size = tuple(float(part) for part in text.replace(",", " ").split())
    except ValueError:
        tab.session.error = f"{name}: {text[:30]!r} is not a size; metres expected"
        tab.redraw()
        return
    _change(tab, name, size_m=size or None)


def _change(tab: "Tab", name: str, **given: Any) -> None:
    if (sheet := tab.session.sheet) is not None:
        objects = (replace(o, **given) if o.name == name else o for o in sheet.marks.objects)
        tab.change(objects=tuple(objects))


def _drop(tab: "Tab", name: str) -> None:
    if tab.session.sheet is not None:
        tab.mark(without_object(tab.session.sheet.marks, name))


def _place(tab: "Tab") -> None:
    tab.placing = "" if tab.placing else NEW
    tab.redraw()


def _track(tab: "Tab") -> None:
    tab.go("track")
    tab.session.track()
