"""Where it fails: the verdict in a sentence, and the stretches to jump to."""

from functools import partial

from nicegui import ui

from galileo_jax.studio.panels import parts
from galileo_jax.studio.tab import Tab


def build(tab: Tab) -> None:
    """The panel."""
    session = tab.session
    parts.title("Where it fails")
    if (found := session.results.compare) is not None:
        ui.label(found["sentence"]).classes("say").props("data-verdict")
        for one in found["stretches"]:
            go = ui.element("button").classes("pick").style("grid-template-columns: 1fr")
            go.props('type=button data-stretch title="go to these frames"')
            go.on("click", partial(_jump, tab, one["clip"], one["start"]))
            with go:
                ui.label(one["sentence"])
        if found["is_adequate"]:
            ui.label("The residuals look like noise: nothing is shaded.").classes("soft")
    if session.states["compare"] != "done":
        parts.main_button("Compare", session.compare, tab, "compare")
        return
    parts.main_button("What is missing?", lambda: _ask(tab), tab, "diagnose")
    parts.plain_button("Predict", lambda: tab.go("predict"), "to-predict")


def _jump(tab: Tab, clip: str, time_s: float) -> None:
    tab.session.look_at(clip)
    parts.go_to(time_s)


def _ask(tab: Tab) -> None:
    tab.go("diagnose")
    if tab.session.states["diagnose"] != "done":
        tab.session.diagnose()
