"""What is missing: candidates as they are computed, `Add` and `Remove`, and the staircase."""

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from nicegui import ui

from galileo_jax.model.effects.forms import FORM_NAMES as NAMES_OF_FORMS
from galileo_jax.runtime.atomic_write import write_text
from galileo_jax.studio import charts
from galileo_jax.studio.panels.parts import main_button, plain_button, remark, title
from galileo_jax.studio.panels.stairs import friction_moves, stairs
from galileo_jax.studio.paths import below

if TYPE_CHECKING:
    from galileo_jax.studio.page import Tab
    from galileo_jax.studio.session import Session

FORM_NAMES = frozenset(NAMES_OF_FORMS)  # they can be tried, not added
MOST_SHOWN = 6
OWN_FILE = "my_effect.py"
OWN_EFFECT = "--effects-from"  # in advice: to write an effect
TEMPLATE = '''from galileo_jax import Effect, LogNormal, Parameter, register_effect


@register_effect
class CubicDrag(Effect):
    """A drag that grows with the cube of the speed."""

    name = "cubic_drag"

    def parameters(self, scene):
        return (Parameter("cubic_drag", "kg s/m^2", LogNormal(0.3, 1.2), 0.0, "effect", 0.1),)

    def force(self, theta, scene):
        c = theta["cubic_drag"][..., None]
        return lambda state: -c * state.speed_m_s**3
'''


def build(tab: "Tab") -> None:
    """The panel."""
    session = tab.session
    title("What is missing")
    found, rounds = session.results.diagnosis, session.results.rounds
    if found is not None and found.get("sentence"):
        ui.label(found["sentence"]).classes("say").props("data-verdict")
    if rounds:
        ui.html(stairs(rounds), sanitize=False).props("data-stairs")
        with ui.element("div"):
            for line in friction_moves(rounds):
                ui.label(line).style("font-variant-numeric: tabular-nums")
    if session.effects:
        with ui.element("div").classes("rowline"):
            for effect in session.effects:
                kept = tuple(one for one in session.effects if one != effect)
                plain_button(
                    f"Remove {effect}", lambda kept=kept: session.fit(kept), "remove",
                    session.job is None,
                )  # fmt: skip
    is_asked = session.job is not None and session.job.task == "diagnose"
    if session.states["diagnose"] != "done" and not is_asked:
        text = "Ask again" if found is not None else "What is missing?"
        main_button(text, session.diagnose, tab, "diagnose")
    status = found.get("verdict", {}).get("status") if found is not None else ""
    if found is not None and status == "unknown":
        _missing(tab, found)
        _own(tab)
    for line in found.get("verdict", {}).get("advice", ()) if found is not None else ():
        if OWN_EFFECT not in line:  # which stands here
            remark("odd", line[:1].upper() + line[1:])
    for i, row in enumerate(session.results.candidates[:MOST_SHOWN]):
        _candidate(tab, row, is_best=i == 0)
    if found is not None and status != "unknown":
        _missing(tab, found)
        if status == "ambiguous":
            _own(tab)
    if session.effects:
        main_button("Predict", lambda: tab.go("predict"), tab, "to-predict")


def _candidate(tab: "Tab", row: Mapping[str, Any], is_best: bool) -> None:
    session, name = tab.session, str(row["effect"])
    pick = ui.element("div").classes("pick")
    pick.props(f'data-candidate="{name}" tabindex=0')
    for event in ("mouseenter", "focus", "click"):
        pick.on(event, lambda: tab.preview(name))
    probability = float(row["probability"] or 0.0)
    with pick:
        law = row.get("law")
        words = name.replace("+", " + ").replace("_", "_\u200b")  # where a line may break
        ui.label(law or words).classes("name")
        ui.label(f"{100 * probability:.3g} %" if probability > 5e-4 else "~0").classes("p")
        with ui.element("div").classes("bar2"):
            ui.element("i").style(f"width: {100 * probability:.1f}%")
        ui.label(_strength(row)).classes("strength")
        effects = tuple(name.split("+"))
        is_in = set(effects) <= set(session.effects)
        if FORM_NAMES & set(effects):
            ui.label("form").classes("small soft").props('title="a form without a name"')
            return
        if law and not _is_verdict(session, law):
            ui.label("law").classes("small soft").props('title="a formula that was also tried"')
            return
        add = ui.button("Added" if is_in else "Add", color=None).props(
            f'unelevated no-caps data-add="{name}"'
        )
        add.classes("main" if is_best and not is_in else "plain")
        add.set_enabled(not is_in and session.job is None)
        wanted = effects if law else _joined(session.effects, effects)
        add.on("click.stop", lambda: session.fit(wanted, is_law=bool(law)))


def _is_verdict(session: "Session", law: str) -> bool:
    found = session.results.diagnosis
    return found is not None and found.get("verdict", {}).get("law") == law


def _joined(one: tuple[str, ...], other: tuple[str, ...]) -> tuple[str, ...]:
    return tuple(dict.fromkeys((*one, *other)))


def _strength(row: Mapping[str, Any]) -> str:
    if "parameters" in row:
        from galileo_jax.report.diagnosis_text import strength_texts

        effects = str(row["effect"]).split("+")
        return ", ".join(strength_texts(effects, row, "±").values())
    return f"velocity error {row['rmse']:.4f} m/s"


def _missing(tab: "Tab", found: Mapping[str, Any]) -> None:
    """The acceleration that the model lacks, or the uneven friction, where there is one."""
    if rows := found.get("friction_along_way"):
        ui.label("The friction coefficient along the way").classes("small soft")
        ui.plotly(charts.friction_figure(rows, tab.dark)).style("height: 230px; width: 100%")
    record = found.get("missing_force")
    if not record:
        return
    ui.label("The acceleration that the model lacks").classes("small soft")
    ui.plotly(charts.missing_figure(record, tab.dark)).style("height: 230px; width: 100%")
    from galileo_jax.report.diagnosis_text import formula_text

    if text := formula_text(found):
        ui.label(text).classes("small")


def _own(tab: "Tab") -> None:
    """To be unfolded."""
    place = ui.expansion("An effect of your own", value=tab.is_writing).classes("w-full")
    place.props("data-own header-class=own")
    place.on_value_change(lambda event: setattr(tab, "is_writing", bool(event.value)))
    with place:
        _editor(tab)


def _editor(tab: "Tab") -> None:
    path = below(tab.session.root, OWN_FILE)
    text = path.read_text(encoding="utf-8") if path.is_file() else TEMPLATE
    area = (
        ui.textarea(value=text if tab.draft is None else tab.draft)
        .props("outlined autogrow data-effect")
        .classes("w-full")
    )
    area.style("font: 13px ui-monospace, monospace; width: 100%")

    # The panel is built anew when results come: what is being written stays.
    area.on_value_change(lambda event: setattr(tab, "draft", event.value))

    def run() -> None:
        write_text(Path(path), area.value or "")
        tab.draft = None
        tab.session.diagnose((OWN_FILE,))

    plain_button(f"Save {OWN_FILE} and run it", run, "run-effect", tab.session.job is None)
