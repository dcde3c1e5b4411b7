"""What is missing: candidates as they are computed, `Add` and `Remove`, and the staircase."""

import math
from collections.abc import Mapping, Sequence
from functools import partial
from html import escape
from typing import Any

from nicegui import ui

from galileo_jax.model.effects.forms import FORM_NAMES
from galileo_jax.report.diagnosis_text import formula_text, strength_texts
from galileo_jax.results.shown import number, shown
from galileo_jax.runtime.atomic_write import write_text
from galileo_jax.studio import charts
from galileo_jax.studio.panels import parts
from galileo_jax.studio.paths import below
from galileo_jax.studio.tab import Tab

MOST_SHOWN = 6
WIDTH, HEIGHT, TOP, BOTTOM = 416, 150, 26, 38  # of the staircase
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


def build(tab: Tab) -> None:
    """The panel."""
    session = tab.session
    parts.title("What is missing")
    found, rounds = session.results.diagnosis, session.results.rounds
    verdict = (found or {}).get("verdict", {})
    if found is not None and found.get("sentence"):
        ui.label(found["sentence"]).classes("say").props("data-verdict")
    if rounds:
        ui.html(stairs(rounds), sanitize=False).props("data-stairs")
        with ui.element("div"):
            for line in friction_moves(rounds):
                ui.label(line).style("font-variant-numeric: tabular-nums")
    if session.effects:
        with parts.row():
            for effect in session.effects:
                kept = tuple(one for one in session.effects if one != effect)
                parts.plain_button(f"Remove {effect}", partial(session.fit, kept), "remove", tab)
    is_asked = session.job is not None and session.job.task == "diagnose"
    if session.states["diagnose"] != "done" and not is_asked:
        text = "Ask again" if found is not None else "What is missing?"
        parts.main_button(text, session.diagnose, tab, "diagnose")
    status = verdict.get("status")
    if found is not None and status == "unknown":
        _missing(tab, found)
        _own(tab)
    for line in verdict.get("advice", ()):
        if OWN_EFFECT not in line:  # which stands here
            parts.remark("odd", line[:1].upper() + line[1:])
    for i, entry in enumerate(session.results.candidates[:MOST_SHOWN]):
        _candidate(tab, entry, verdict.get("law"), is_best=i == 0)
    if found is not None and status != "unknown":
        _missing(tab, found)
        if status == "ambiguous":
            _own(tab)
    if session.effects:
        parts.main_button("Predict", lambda: tab.go("predict"), tab, "to-predict")


def _candidate(tab: Tab, entry: Mapping[str, Any], verdict_law: str | None, is_best: bool) -> None:
    """A row that shows the candidate's curve; `verdict_law`: the formula that was found."""
    session, name, law = tab.session, str(entry["effect"]), entry.get("law")
    effects, probability = tuple(name.split("+")), float(entry["probability"] or 0.0)
    pick = ui.element("div").classes("pick").props(f'data-candidate="{name}" tabindex=0')
    for event in ("mouseenter", "focus", "click"):
        pick.on(event, lambda: tab.preview(name))
    strength = f"velocity error {entry['rmse']:.4f} m/s" if "parameters" not in entry else None
    with pick:
        words = name.replace("+", " + ").replace("_", "_\u200b")  # where a line may break
        ui.label(law or words).classes("name")
        ui.label(f"{100 * probability:.3g} %" if probability > 5e-4 else "~0").classes("p")
        with ui.element("div").classes("bar2"):
            ui.element("i").style(f"width: {100 * probability:.1f}%")
        said = strength or ", ".join(strength_texts(entry, "±").values())
        ui.label(said).classes("strength")
        if set(FORM_NAMES) & set(effects):  # they can be tried, not added
            ui.label("form").classes("small soft").props('title="a form without a name"')
            return
        if law and law != verdict_law:
            ui.label("law").classes("small soft").props('title="a formula that was also tried"')
            return
        is_in = set(effects) <= set(session.effects)
        add = ui.button("Added" if is_in else "Add", color=None)
        add.props(f'unelevated no-caps data-add="{name}"')
        add.classes("main" if is_best and not is_in else "plain")
        add.set_enabled(not is_in and tab.is_idle)
        wanted = effects if law else tuple(dict.fromkeys((*session.effects, *effects)))
        add.on("click.stop", lambda: session.fit(wanted, is_law=bool(law)))


def _missing(tab: Tab, found: Mapping[str, Any]) -> None:
    """The acceleration that the model lacks, or the uneven friction, where there is one."""
    if rows := found.get("friction_along_way"):
        _chart("The friction coefficient along the way", charts.friction_figure(rows, tab.dark))
    if record := found.get("missing_force"):
        _chart("The acceleration that the model lacks", charts.missing_figure(record, tab.dark))
        if text := formula_text(found):
            ui.label(text).classes("small")


def _chart(heading: str, figure: Mapping[str, Any]) -> None:
    ui.label(heading).classes("small soft")
    ui.plotly(dict(figure)).style("height: 230px; width: 100%")


def _own(tab: Tab) -> None:
    """An editor, to be unfolded."""
    path = below(tab.session.root, OWN_FILE)
    text = path.read_text(encoding="utf-8") if path.is_file() else TEMPLATE
    place = ui.expansion("An effect of your own", value=tab.is_writing).classes("w-full")
    place.props("data-own header-class=own")
    place.on_value_change(lambda event: setattr(tab, "is_writing", bool(event.value)))
    with place:
        area = ui.textarea(value=text if tab.draft is None else tab.draft).classes("w-full")
        area.props("outlined autogrow data-effect")
        area.style("font: 13px ui-monospace, monospace; width: 100%")
        # The panel is built anew when results come: what is being written stays.
        area.on_value_change(lambda event: setattr(tab, "draft", event.value))

        def run() -> None:
            write_text(path, area.value or "")
            tab.draft = None
            tab.session.diagnose((OWN_FILE,))

        parts.plain_button(f"Save {OWN_FILE} and run it", run, "run-effect", tab)


def stairs(rounds: Sequence[Mapping[str, Any]]) -> str:
    """An SVG: the velocity error of each round on a logarithmic scale, the noise dotted."""
    errors = [max(float(one["rmse"]), 1e-9) for one in rounds]
    noise = max(float(rounds[-1]["noise"]), 1e-9)
    high, low = math.log(max(*errors, noise) * 1.2), math.log(min(*errors, noise) / 1.3)

    def y(value: float) -> float:
        return TOP + (high - math.log(value)) / (high - low) * (HEIGHT - TOP - BOTTOM)

    step = WIDTH / max(len(rounds), 2)
    path, texts = "", []
    for i, (one, error) in enumerate(zip(rounds, errors, strict=True)):
        left, right = i * step, (i + 1) * step
        path += f"{'L' if path else 'M'}{left:.1f} {y(error):.1f}L{right:.1f} {y(error):.1f}"
        name = "+ " + str(one["effects"][-1]) if one["effects"] else "no effects"
        texts.append(
            f'<text x="{left + 6:.1f}" y="{y(error) - 7:.1f}" font-weight="600">{error:.4f} m/s'
            f'</text><text class="soft" x="{left + 6:.1f}" y="{HEIGHT - 20}">{escape(name)}</text>'
            f'<text class="soft" x="{left + 6:.1f}" y="{HEIGHT - 4}">chi2 '
            f"{float(one['chi2_per_dof']):.3g}</text>"
        )
    floor = y(noise)
    return (
        f'<svg class="stairs" viewBox="0 0 {WIDTH} {HEIGHT}" role="img" aria-label="velocity error '
        f'round by round"><line x1="0" x2="{WIDTH}" y1="{floor:.1f}" y2="{floor:.1f}" '
        f'stroke="var(--soft)" stroke-dasharray="3 4"/><text class="soft" x="{WIDTH - 2}" '
        f'y="{floor + 14:.1f}" text-anchor="end">noise</text>'
        f'<path d="{path}" fill="none" stroke="var(--accent)" stroke-width="3"/>'
        f"{''.join(texts)}</svg>"
    )


def friction_moves(rounds: Sequence[Mapping[str, Any]]) -> list[str]:
    """How the last round moved k1 and k2, in words."""
    found = []
    for name in ("k1", "k2"):
        if name not in rounds[-1]:
            continue
        now = rounds[-1][name]
        text = f"{name} {shown(now)} ± {shown(now, 'sd')}"
        if len(rounds) > 1 and name in rounds[-2]:
            before = rounds[-2][name]["mean"]
            arrow = "↑" if now["mean"] > before else "↓"
            change = abs(now["mean"] - before)
            text += f"  {arrow} {number(change, now['sd'])} (from {before:.3g})"
        found.append(text)
    return found
