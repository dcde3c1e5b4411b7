"""Fit: every parameter with its interval and a slider that moves the model at once."""

from collections.abc import Mapping
from typing import Any

from nicegui import ui

from galileo_jax.report.fit_text import distance_text
from galileo_jax.results.shown import interval_text, is_as_declared, shown, unit_text
from galileo_jax.studio.panels import parts
from galileo_jax.studio.results import program_of
from galileo_jax.studio.tab import Tab


def build(tab: Tab) -> None:
    """The panel."""
    session = tab.session
    effects = ", ".join(session.effects)
    parts.title(f"Fit, with {effects}" if effects else "Fit")
    if (found := session.results.fit) is None:
        if (program := program_of(session.trials.run)) is not None:
            text = f"Run {program.rpartition('/')[2]} and open it"
            parts.plain_button(text, lambda: session.open_run(is_pressed=True), "open-program")
        elif session.trials.file("fit").is_file():
            ui.label("Opening the run …").classes("soft")
        parts.main_button("Fit", session.fit, tab, "fit")
        return
    error = found["error"]
    with ui.element("div").classes("say"):
        misfit = ui.label(_misfit(tab))
        ui.label(
            f"chi2 per degree of freedom {error['chi2_per_dof']:.3g}; velocity error "
            f"{error['rmse']:.4f} m/s (noise {error['noise']:.4f})"
        ).classes("soft small")
        if near := distance_text(error):
            ui.label(near).classes("soft small")
    values = dict(session.results.live["values"]) if session.results.live is not None else {}
    for one in found["parameters"]:
        _parameter(tab, one, values)
    ui.timer(0.15, lambda: misfit.set_text(_misfit(tab)))
    with parts.row():
        parts.plain_button("Back to the best", lambda: _back(tab), "back")
        if session.states["fit"] == "stale":
            parts.main_button("Fit again", lambda: session.fit(session.effects), tab, "fit")
        else:
            parts.main_button("Where does it fail?", lambda: tab.go("compare"), tab, "to-compare")
    for line in (*found["warnings"], *found["exact"]):
        parts.remark("odd", line.split(": ", 1)[-1])


def _misfit(tab: Tab) -> str:
    results = tab.session.results
    if results.fit is None:
        return ""
    motions = (results.live or results.fit)["motions"]
    misfits = [one["misfit"] for one in motions if one["misfit"] is not None]
    rms = (sum(m**2 for m in misfits) / len(misfits)) ** 0.5 if misfits else 0.0
    return f"The model misses the points by {rms:.3g} times the noise."


def _parameter(tab: Tab, one: Mapping[str, Any], values: dict[str, float]) -> None:
    """A parameter with its slider; `values`: where the sliders are, which it changes."""
    is_known, name = one["identified"], one["name"]

    def move(event: Any) -> None:
        values[name] = float(event.args)
        tab.session.move_model(values)

    with ui.element("div").classes("parameter" + ("" if is_known else " unknown")):
        ui.label(name).classes("name")
        with ui.element("div").classes("value"):
            ui.label(f"{shown(one)}{unit_text(one)}")
            told = "as declared" if is_as_declared(one) else "not determined by this clip"
            interval = interval_text(one) if is_known else told
            ui.label(interval).classes("small soft")
        if one["kind"] != "parameters":
            ui.label("follows from the others").classes("small soft")
            return
        start = values.get(name, one["mean"])
        slider = ui.slider(min=one["low"], max=one["high"], value=start, step=one["step"])
        slider.props(f'label data-slider="{name}" aria-label="{name}"')
        slider.on("update:model-value", move, throttle=0.06)


def _back(tab: Tab) -> None:
    tab.session.put_back()
    tab.drawn = None  # the sliders, too
    tab.redraw()
