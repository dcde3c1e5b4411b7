"""Explain: what the film shows in a sentence, what is asked of it, and the result in words."""

from collections.abc import Mapping
from typing import Any
from urllib.parse import quote

from nicegui import ui

from galileo_jax.clip.file_kinds import TRACK_SUFFIXES, YAML_SUFFIXES
from galileo_jax.studio.panels import parts
from galileo_jax.studio.tab import Tab

POINTS = "points"  # the question that a click into the video answers
FILES = ",".join(("video/*", *TRACK_SUFFIXES, *YAML_SUFFIXES))  # that may be dropped


def build(tab: Tab) -> None:
    """The panel."""
    session = tab.session
    parts.title("Explain")
    ui.label("").classes("said")
    if not session.active:
        for name, problem in session.broken.items():
            ui.label(f"{name}: {problem}").classes("trouble").props("data-sentence")
    elif (seen := session.seen) is None:
        name = session.sheets[session.active].source.name
        ui.label(f"Looking at {name} …").classes("soft")
    elif "problem" in seen:
        ui.label(seen["problem"]).classes("trouble").props('data-sentence role="alert"')
    else:
        _asked(tab, seen)
    if session.active and session.results.paragraph:
        _explained(tab)
    _drop()


def drawn(tab: Tab) -> Any:
    """While this is the same, `Tab.refresh` is enough to show what has changed."""
    session = tab.session
    if tab.stage != "explain":
        return None
    seen = session.seen or {}
    asked = tuple((one["key"], one["default"], one["why"]) for one in seen.get("questions", ()))
    return (
        "explain", session.active, session.chosen, session.seen is None, seen.get("problem"), asked,
        session.results.paragraph, session.error, session.note, tab.is_idle, tab.placing,
        tuple(session.broken),
    )  # fmt: skip


def _asked(tab: Tab, seen: Mapping[str, Any]) -> None:
    """The sentence, the questions and the button; what is typed changes words, and no field."""
    session = tab.session
    sentence = ui.label(seen["sentence"]).classes("say").props("data-sentence")
    words = {one["key"]: _question(tab, one) for one in seen["questions"]}
    with parts.row():
        parts.main_button("Explain", session.explain, tab, "explain")
        if not seen["questions"] and session.answered:
            parts.plain_button("Answer anew", session.answer_anew, "anew", tab)

    def refresh() -> None:
        now = session.seen or {}
        sentence.set_text(now.get("sentence", ""))
        for key, word in words.items():
            is_typed = bool(session.typed.get(key, "").strip())
            word.set_text(now.get("problems", {}).get(key, "") if is_typed else "")

    tab.refresh = refresh
    refresh()


def _question(tab: Tab, one: Mapping[str, Any]) -> Any:
    """A question with its field; returns the place of what is wrong with its answer."""
    key, likely = one["key"], one["default"]
    typed = tab.session.typed.get(key)
    with ui.element("div").classes("question").props(f'data-question="{key}"'):
        ui.label(one["text"])
        ui.label(one["why"]).classes("soft small")
        if one["choices"]:
            said = f"{likely}: looks like this one" if key == "scenario" else likely
            choices = {one: one for one in one["choices"] if one != likely}
            choices = ({likely: said} if likely else {}) | choices  # the likely one first
            field = ui.select(choices, value=typed or likely).props("options-dense")
            field.on_value_change(lambda event: tab.session.say(key, str(event.value)))
        else:
            field = ui.input(value=likely or "" if typed is None else typed)
            parts.on_entered(field, lambda text: tab.session.say(key, text))
        field.props(f'outlined dense data-answer="{key}" aria-label="{key}"')
        if key == POINTS:
            text = "Click on it in the film" if tab.placing else "Show it in the film"
            parts.plain_button(text, lambda: _place(tab), "point")
        return ui.label("").classes("wrong small")


def _place(tab: Tab) -> None:
    parts.go_to(0.0)
    tab.place(POINTS)


def _explained(tab: Tab) -> None:
    """The paragraph, and its report as a file."""
    session, job = tab.session, tab.session.job
    ui.label(session.results.paragraph).classes("say").props("data-paragraph")
    if job is not None and job.task == "explain":
        ui.label("What is missing is still being asked.").classes("soft")
        return
    for name in session.chosen:
        which = f" of {name}" if len(session.chosen) > 1 else ""
        ui.html(
            f'<a class="choose" href="/report/{quote(name)}" download="{name}.html" '
            f"data-do=save-report>Save the report{which}</a>",
            sanitize=False,
        )
    for line in session.results.notes:
        parts.remark("odd", line)


def _drop() -> None:
    """Where a file is dropped or chosen."""
    with ui.element("div").classes("drop").props("data-drop"):
        ui.label("Drop a film or a table here").style("margin-bottom: 8px")
        with ui.element("label").classes("choose"):
            ui.label("or choose a file")
            ui.html(
                f'<input type="file" accept="{FILES}" multiple aria-label="open a file" '
                'onchange="galileoUpload(this.files)" style="min-height: 44px">',
                sanitize=False,
            )
