"""Pieces that several panels have."""

import contextlib
from collections.abc import Callable
from typing import Any

from nicegui import ui

from galileo_jax.studio.tab import Tab


def title(text: str) -> None:
    """What the panel is about."""
    with ui.element("h2"):
        ui.html(text, sanitize=False)


def row(is_one_line: bool = False) -> ui.element:
    """Its elements stand beside each other."""
    found = ui.element("div").classes("rowline")
    return found.style("flex-wrap: nowrap") if is_one_line else found


def main_button(text: str, action: Callable[[], Any], tab: Tab, name: str) -> None:
    """The button that does the stage's work; off while something is computed."""
    button = ui.button(text, on_click=action, color=None).classes("main")
    button.props(f"unelevated no-caps data-do={name}").set_enabled(tab.is_idle)


def plain_button(
    text: str, action: Callable[[], Any], name: str, waits_for: Tab | None = None
) -> None:
    """Another button; with a tab off while something is computed."""
    button = ui.button(text, on_click=action, color=None).classes("plain")
    button.props(f"outline no-caps data-do={name}")
    button.set_enabled(waits_for is None or waits_for.is_idle)


def icon_button(icon: str, label: str, action: Callable[[], Any]) -> None:
    """A round button with a picture."""
    button = ui.button(icon=icon, on_click=action, color=None).props("flat round").classes("icon")
    button.props(f'aria-label="{label}" title="{label}"')


def remark(kind: str, sentence: str) -> None:
    """One sentence with its colour."""
    with ui.element("div").classes(f"remark {kind}").props(f'data-remark="{kind}"'):
        ui.label(sentence)


def go_to(time_s: float) -> None:
    """Shows the video's frame at a time."""
    ui.run_javascript(f"dispatchEvent(new CustomEvent('galileo-go', {{detail: {time_s:.4f}}}))")


def on_entered(field: Any, action: Callable[[str], Any]) -> None:
    """Calls `action` with what was typed, when the person goes on.

    Not with the field's value in Python: that follows a little later.
    """
    field.on("change", lambda event: action("" if event.args is None else str(event.args)))


def number_field(
    label: str, value: float | None, action: Callable[[float | None], Any], props: str, **given: Any
) -> Any:
    """A field of a number; `action` is given None where it was emptied, nothing where it is none.

    `given`: what else `ui.number` is told.
    """

    def entered(text: str) -> None:
        with contextlib.suppress(ValueError):
            action(float(text) if text else None)

    field = ui.number(label, value=value, **given).props(f"outlined dense {props}")
    on_entered(field, entered)
    return field
