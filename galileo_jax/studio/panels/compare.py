"""Where it fails: the verdict in a sentence, and the stretches to jump to."""

from functools import partial
from typing import TYPE_CHECKING

from nicegui import ui

from galileo_jax.studio.panels.parts import main_button, plain_button, title

if TYPE_CHECKING:
    from galileo_jax.studio.page import Tab


def build(tab: "Tab") -> None:
    """The panel."""
    session = tab.session
    found = session.results.compare
    title("Where it fails")
    if found is not None:
        ui.label(found["sentence"]).classes("say").props("data-verdict")
        for one in found["stretches"]:
            go = (
                ui.element("button")
                .classes("pick")
                .props('type=button data-stretch title="go to these frames"')
            )
            go.style("grid-template-columns: 1fr")
            go.on("click", partial(_jump, tab, one["clip"], one["start"]))
            with go:
                ui.label(one["sentence"])
        if found["is_adequate"]:
            ui.label("The residuals look like noise: nothing is shaded.").classes("soft")
    state = session.states["compare"]
    if state != "done":
        main_button("Compare", session.compare, tab, "compare")
        return
    main_button("What is missing?", lambda: _ask(tab), tab, "diagnose")
    plain_button("Predict", lambda: tab.go("predict"), "to-predict")


def _jump(tab: "Tab", clip: str, time_s: float) -> None:
    tab.session.look_at(clip)
    script = f"window.dispatchEvent(new CustomEvent('galileo-go', {{detail: {time_s:.4f}}}))"
    ui.run_javascript(script)


def _ask(tab: "Tab") -> None:
    tab.go("diagnose")
    if tab.session.states["diagnose"] != "done":
        tab.session.diagnose()
