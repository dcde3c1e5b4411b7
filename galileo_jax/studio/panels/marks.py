"""Marks: everything in the first frame that the program must know, to be dragged; and `Check`."""

from dataclasses import replace
from functools import partial
from typing import Any

from nicegui import ui

from galileo_jax.clip.fields import SIZE_MEANING
from galileo_jax.clip.scenarios import SCENARIOS
from galileo_jax.studio.marks import Marks, ObjectMark, with_other, with_rectangle, without_object
from galileo_jax.studio.panels import parts
from galileo_jax.studio.tab import Tab

NEW = "a new object"  # what a click into the video places


def build(tab: Tab) -> None:
    """The panel."""
    session = tab.session
    parts.title("Marks")
    if session.sheet is None:
        ui.label("A table has no pictures: what is declared stands in its yaml.").classes("soft")
        return
    marks = session.sheet.marks
    with parts.row():
        scene = ui.select(sorted(SCENARIOS), value=marks.scenario, label="scenario")
        scene.props("outlined dense options-dense").style("min-width: 130px")
        scene.on_value_change(lambda event: tab.change(scenario=event.value))
        lengths = [_length(tab, i, *one) for i, one in enumerate(_lengths(marks).items())]
        text = "Rectangle instead" if marks.rectangle is None else "Ruler instead"
        parts.plain_button(text, lambda: _turn(tab), "rectangle")
    sizes = {one.name: _object(tab, one) for one in marks.objects}
    with parts.row():
        text = "Click on the object" if tab.placing else "Add object"
        parts.plain_button(text, lambda: tab.place(NEW), "add-object")
        parts.plain_button("Find objects", session.propose, "propose", tab)
    parts.title("Check")
    place = ui.element("div").style("display: contents")
    shown: list[Any] = [None]
    told: dict[Any, Any] = {}  # what a field was last told: what is being typed into it stays

    def refresh() -> None:
        """The rest of the panel stays, so that nothing is swept away while somebody types."""
        sheet = session.sheet
        if sheet is None:
            return
        values = dict(zip(lengths, _lengths(sheet.marks).values(), strict=True))
        values |= {sizes[one.name]: _text(one.size_m) for one in sheet.marks.objects}
        for field, value in values.items():
            if field not in told or told[field] != value:
                told[field] = value
                field.set_value(value)
        now = (sheet.remarks, sheet.is_complete, tab.is_idle)
        if now == shown[0]:
            return  # a button that is about to be pressed stays where it is
        shown[0] = now
        place.clear()
        with place:
            for one in sheet.remarks:
                parts.remark(one.kind, one.sentence)
            if sheet.is_complete:
                parts.remark("fine", "Everything is there: the clip can be tracked.")
                parts.main_button("Track", lambda: tab.go_on("track", session.track), tab, "track")

    tab.refresh = refresh
    refresh()


def drawn(tab: Tab) -> Any:
    """While this is the same, `Tab.refresh` is enough to show what has changed."""
    session, sheet = tab.session, tab.session.sheet
    if tab.stage != "marks" or sheet is None:
        return None
    objects = tuple((one.name, one.shape) for one in sheet.marks.objects)
    said = (session.error, session.note, tab.is_idle, session.chosen, session.active)
    return (sheet.marks.scenario, objects, sheet.marks.rectangle is None, tab.placing, said)


def _lengths(marks: Marks) -> dict[str, float | None]:
    """What tells the scale, by the names of its fields."""
    if marks.rectangle is None:
        return {"ruler, m": marks.stick_m}
    width, height = marks.rectangle_m
    return {"width, m": width or None, "height, m": height or None}


def _length(tab: Tab, index: int, label: str, value: float | None) -> Any:
    is_ruler = label.startswith("ruler")

    def write(value: float | None) -> None:
        sheet = tab.session.sheet
        if is_ruler:
            tab.change(stick_m=value or None)
        elif sheet is not None:
            sides = list(sheet.marks.rectangle_m)
            sides[index] = value or 0.0
            tab.change(rectangle_m=tuple(sides))

    mark = "data-stick" if is_ruler else f"data-side={index}"
    return parts.number_field(label, value, write, f"{mark} step=any", min=0).style("width: 118px")


def _turn(tab: Tab) -> None:
    """To a rectangle of known sides, and back to the ruler."""
    if (sheet := tab.session.sheet) is not None:
        is_laid = sheet.marks.rectangle is not None
        plain = replace(sheet.marks, rectangle=None)
        tab.mark(plain if is_laid else with_rectangle(plain, sheet.info.size_px))


def _text(size: tuple[float, ...] | None) -> str:
    return " ".join(f"{side:g}" for side in size or ())


def _object(tab: Tab, one: ObjectMark) -> Any:
    """A row of the list; returns the field of its size."""
    name = one.name
    with parts.row(is_one_line=True):
        ui.label(name).style("font-weight: 600; min-width: 68px")
        shape = ui.select(list(SIZE_MEANING), value=one.shape).props("outlined dense options-dense")
        shape.style("min-width: 96px")
        shape.on_value_change(
            lambda event: tab.edit(with_other, name, shape=event.value, size_m=None)
        )
        size = ui.input(label="size, m", value=_text(one.size_m), placeholder="if known")
        meaning = f"{SIZE_MEANING[one.shape]}, m"
        size.props(f'outlined dense title="{meaning}" data-size={name}').style("flex: 1")
        parts.on_entered(size, lambda text: _size(tab, name, text))
        parts.icon_button("close", f"Remove {name}", partial(tab.edit, without_object, name))
    return size


def _size(tab: Tab, name: str, text: str) -> None:
    try:
        size = tuple(float(part) for part in text.replace(",", " ").split())
    except ValueError:
        tab.session.error = f"{name}: {text[:30]!r} is not a size; metres expected"
        tab.redraw()
        return
    tab.edit(with_other, name, size_m=size or None)
