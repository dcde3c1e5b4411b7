"""Predict and keep: where it stops, exports, and the commands and API lines that do the same."""

import shlex
from functools import partial

from nicegui import ui

from galileo_jax.results.command_line import command_line
from galileo_jax.studio.panels import parts
from galileo_jax.studio.tab import Tab

SECONDS = 2.0


def build(tab: Tab) -> None:
    """The panel."""
    session = tab.session
    found = (session.results.prediction or {"clips": {}})["clips"].get(session.active)
    parts.title("Predict")
    with parts.row():
        seconds = ui.number("seconds beyond the clip", value=SECONDS, min=0.1, max=60)
        seconds.props("outlined dense step=any")
        go_on = lambda: session.predict(float(seconds.value or SECONDS))  # noqa: E731
        parts.main_button("Predict", go_on, tab, "predict")
    if found is not None:
        with ui.element("div").classes("answers"):
            for line in found["sentences"]:
                ui.label(line.strip()).classes("detail" if line.startswith(" ") else "")
        if session.states["predict"] == "done":
            place = f"/still/{session.active}?{session.versions['results']}"
            seen = "the last frame, and where the objects come to rest"
            ui.html(f'<img class="still" src="{place}" alt="{seen}">', sanitize=False)
    parts.title("Keep")
    with parts.row():
        for kind in ("csv", "netcdf"):
            parts.plain_button(kind, partial(session.export, kind), f"export-{kind}", tab)
    ui.label(f"runs/{session.trials.name}/report.html").classes("soft small")
    ui.label("The same in the terminal").classes("small soft")
    ui.label(_commands(tab)).classes("code").props("data-commands")
    ui.label("The same in Python").classes("small soft")
    ui.label(_lines(tab)).classes("code").props("data-lines")


def _commands(tab: Tab) -> str:
    session = tab.session
    clips, run = session.trials.files, f"runs/{session.trials.name}"
    lines = [f"cd {shlex.quote(str(session.root))}"]
    if session.results.paragraph:
        lines.append(command_line("explain", clips))
    else:
        if session.results.diagnosis is not None:
            lines.append(command_line("diagnose", clips, add="none"))
        lines.append(command_line("fit", clips, effects=",".join(session.effects)))
        lines.append(command_line("compare", [run]))
    runs = [run] if len(session.chosen) == 1 else [f"{run}/{name}" for name in session.chosen]
    lines += [command_line("predict", [one], seconds=f"{SECONDS:g}") for one in runs]
    return "\n".join(lines)


def _lines(tab: Tab) -> str:
    session = tab.session
    files = session.trials.files
    clips = repr(files[0]) if len(files) == 1 else repr(files)
    run = f"runs/{session.trials.name}"
    effects = f", effects={list(session.effects)!r}" if session.effects else ""
    lines = ["import galileo_jax as gx", ""]
    if session.results.paragraph:
        lines.append(f"fit = gx.explain({clips}, out={run!r}).fit")
    else:
        if session.results.diagnosis is not None:
            lines.append(f"found = gx.diagnose({clips}, add='none')")
        lines += [f"fit = gx.fit({clips}{effects}).save({run!r})", "check = gx.compare(fit)"]
    if len(files) == 1:
        lines.append(f"ahead = gx.predict(fit, seconds={SECONDS:g})")
    else:
        folders = [f"{run}/{name}" for name in session.chosen]
        lines.append(f"ahead = [gx.predict(one, seconds={SECONDS:g}) for one in {folders!r}]")
    return "\n".join(lines)
