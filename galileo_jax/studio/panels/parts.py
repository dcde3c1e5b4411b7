"""Pieces that several panels have."""

import contextlib
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

from nicegui import ui

if TYPE_CHECKING:
    from galileo_jax.studio.page import Tab


def title(text: str) -> None:
    """What the panel is about."""
    with ui.element("h2"):
        ui.html(text, sanitize=False)


def main_button(text: str, action: Callable[[], Any], tab: "Tab", name: str) -> None:
    """The button that does the stage's work; off while something is computed."""
    button = ui.button(text, on_click=action, color=None).props(
        f"unelevated no-caps data-do={name}"
    )
    button.classes("main").set_enabled(tab.session.job is None)


def plain_button(text: str, action: Callable[[], Any], name: str, enabled: bool = True) -> None:
    """Another button."""
    button = ui.button(text, on_click=action, color=None).props(f"outline no-caps data-do={name}")
    button.classes("plain").set_enabled(enabled)


def remark(kind: str, sentence: str) -> None:
    """One sentence with its colour."""
    with ui.element("div").classes(f"remark {kind}").props(f'data-remark="{kind}"'):
        ui.label(sentence)


def on_entered(field: Any, action: Callable[[str], Any]) -> None:
    """Calls `action` with what was typed, when the person goes on.

    Not with the field's value in Python: that follows a little later.
    """
    field.on("change", lambda event: action("" if event.args is None else str(event.args)))


def on_number(field: Any, action: Callable[[float | None], Any]) -> None:
    """The same of a number; None where it was emptied, nothing where it is none."""

    def entered(text: str) -> None:
        with contextlib.suppress(ValueError):
            action(float(text) if text else None)

    on_entered(field, entered)
