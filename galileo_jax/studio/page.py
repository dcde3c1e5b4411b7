"""The page of one tab: the stages above, the video and its curves left, the stage's panel right."""

import asyncio
import time
from functools import partial
from pathlib import Path
from typing import Any

from nicegui import ui

from galileo_jax.studio import charts
from galileo_jax.studio.marks import corrected, moved, with_object
from galileo_jax.studio.panels import compare, diagnose, explain, fit, marks, predict, track, video
from galileo_jax.studio.panels.parts import icon_button, row
from galileo_jax.studio.session import Session
from galileo_jax.studio.stages import STAGES
from galileo_jax.studio.tab import Tab
from galileo_jax.studio.viewer import Viewer

HERE = Path(__file__).parent
PANELS = {
    "explain": explain.build,
    "video": video.build,
    "marks": marks.build,
    "track": track.build,
    "fit": fit.build,
    "compare": compare.build,
    "diagnose": diagnose.build,
    "predict": predict.build,
}
POLL_S = 0.1
CURVES_AFTER_S = 0.03
PARTS = {
    "video": {"clips", "marks"},
    "marks": {"clips", "marks"},
    "explain": {"clips", "results"},
}  # that their panels show
RUNNING = {"propose": "marks", "open_run": "fit", "export": "predict"}  # else its own stage
WORDS = {
    "locked": "waiting for the step before it",
    "open": "to do",
    "done": "done",
    "stale": "made with earlier marks",
    "running": "running",
}


def build_page(session: Session) -> None:
    """Builds the page of a new tab."""
    ui.add_head_html(f"<style>{(HERE / 'studio.css').read_text(encoding='utf-8')}</style>")
    ui.add_body_html(f"<script>{(HERE / 'studio.js').read_text(encoding='utf-8')}</script>")
    ui.colors(primary="#b34d25")
    tab = Tab(session, _first_stage(session))
    page = _Page(tab)
    tab.redraw, tab.redraw_curves = page.show, page.curves
    page.show()
    if tab.stage in ("fit", "compare", "diagnose", "predict"):
        session.open_run()
    ui.timer(POLL_S, page.look)


class _Page:
    """The elements of a tab's page, and what they show by now."""

    def __init__(self, tab: Tab):
        self._tab, self._session = tab, tab.session
        self._seen = dict(tab.session.versions)
        self._figure: Any = None
        self._dark = ui.dark_mode(None)
        with ui.element("header").classes("bar"):
            ui.label("galileo studio").classes("brand")
            self._stages = ui.element("nav").classes("stages").props('aria-label="stages"')
            with ui.element("div").classes("end"):
                icon_button("undo", "Undo", self._session.undo)
                icon_button("redo", "Redo", self._session.redo)
                icon_button("contrast", "Light or dark", self._turn)
        with ui.element("main").classes("work"):
            with ui.element("section").classes("left"):
                self._viewer = Viewer()
                self._strip = ui.element("div").classes("strip timed")
                with self._strip:
                    self._chart = ui.plotly(charts.EMPTY)
            self._panel = ui.element("aside").classes("right")
        self._job = ui.element("div")
        self._viewer.on("moved", self._on_moved)
        self._viewer.on("place", self._on_place)
        self._viewer.on("frame", lambda event: setattr(tab, "frame", int(event.args)))

    def _turn(self) -> None:
        self._dark.value = self._tab.dark = not self._tab.dark
        self.show()

    def _on_moved(self, event: Any) -> None:
        given = event.args
        self._tab.edit(moved, given["handle"], (given["x"], given["y"]))

    def _on_place(self, event: Any) -> None:
        tab = self._tab
        if self._session.sheet is None or not tab.placing:
            return
        (x, y, frame), name, tab.placing = event.args, tab.placing, ""
        if name == explain.POINTS:
            self._session.say(name, f"{x:.0f} {y:.0f}")
            self.show()
        elif name == marks.NEW:
            tab.edit(with_object, (x, y))
        else:
            tab.edit(corrected, name, int(frame), (x, y))
            self._session.track()

    def show(self) -> None:
        """Shows everything anew."""
        tab = self._tab
        self._seen.update(self._session.versions)
        self._lamps()
        self._viewer.show(self._session, tab.stage, bool(tab.placing))
        self._viewer.set_visibility(self._session.sheet is not None)
        if tab.drawn == (now := _shown(tab)):
            tab.refresh()
        else:
            tab.refresh = lambda: None
            self._panel.clear()
            with self._panel:
                _panel(tab)
            tab.drawn = now
        self._bar()
        # A browser that draws curves shows nothing else meanwhile: the click's answer goes first.
        asyncio.get_running_loop().call_later(CURVES_AFTER_S, self.curves)

    def _lamps(self) -> None:
        tab, job, states = self._tab, self._session.job, self._session.states
        task = job.task if job else ""
        now = (tab.stage, task, *states.values())
        if now == tab.lamps:
            return
        tab.lamps = now
        self._stages.clear()
        for stage, title in STAGES.items():
            state = "running" if stage == RUNNING.get(task, task) else states[stage]
            with self._stages, ui.element("button").classes("stagebutton") as button:
                ui.element("span").classes(f"lamp {state}")
                ui.label(title)
            button.props(f"type=button data-stage={stage} data-state={state}")
            button.props(f'title="{title}: {WORDS[state]}"')
            if stage == tab.stage:
                button.props('aria-current="step"')
            if states[stage] == "locked":
                button.props("disabled")
            button.on("click", partial(tab.go, stage))

    def curves(self) -> None:
        """Shows the video and what is below it anew."""
        self._viewer.show(self._session, self._tab.stage, bool(self._tab.placing))
        figure = _figure(self._tab)
        self._strip.classes(add="" if figure else "none", remove="none" if figure else "")
        if figure is not None and figure != self._figure:
            self._chart.update_figure(figure)
            self._figure = figure

    def _bar(self) -> None:
        """What is computed, how far it is, and how to stop it."""
        self._job.clear()
        if (job := self._session.job) is None:
            return
        with self._job, ui.element("div").classes("job").props('role="status"'):
            text = "stopping" if job.is_cancelled else job.stage
            said = ", ".join(filter(None, (text, job.time_left(time.monotonic()))))
            ui.label(f"{STAGES.get(job.task, 'Looking')}: {said}").classes("small")
            with ui.element("div").classes("meter"):
                ui.element("i").style(f"width: {100 * job.share:.0f}%")
            if not job.is_cancelled:
                cancel = ui.button("Cancel", on_click=self._session.cancel, color=None)
                cancel.props("flat no-caps")

    def look(self) -> None:
        """Shows what has changed since it was looked last."""
        session, tab = self._session, self._tab
        if tab.stage == "explain":
            session.understand()
        now = session.versions
        new = {part for part in now if self._seen.get(part) != now[part]}
        self._seen.update(now)
        if "opened" in new:
            tab.go("explain")
        elif new & PARTS.get(tab.stage, {"clips", "marks", "results"}):
            self.show()
        elif new & {"clips", "marks", "results"}:
            self._lamps()
            self.curves()
        elif "live" in new:
            self.curves()
        if "job" in new:
            self._bar()
            said = (session.job.task if session.job else "", session.error, session.note)
            if said != tab.said:
                tab.said = said
                self.show()


def _shown(tab: Tab) -> Any:
    """What a panel is built of: while it is the same, the panel stays as it is."""
    if (now := marks.drawn(tab) or explain.drawn(tab)) is not None:
        return now
    session = tab.session
    found = session.results
    views = (*found.tracks.values(), found.fit, found.compare, found.diagnosis, found.prediction)
    return (
        tab.stage, tab.dark, tab.placing, session.active, session.chosen, session.names,
        session.error, session.note, tab.is_idle, tuple(session.states.values()),
        tuple(map(id, views)), found.candidates, found.rounds, tuple(session.broken), session.sheet,
    )  # fmt: skip


def _first_stage(session: Session) -> str:
    """The stage that a clip has come to."""
    states = session.states
    is_new = session.sheet is None or not {"done", "stale"} & {states["track"], states["fit"]}
    if is_new or states["explain"] != "open":
        return "explain"
    if states["diagnose"] in ("done", "stale"):
        return "diagnose"
    return next((s for s in ("track", "fit", "compare") if states[s] != "done"), "diagnose")


def _panel(tab: Tab) -> None:
    session = tab.session
    if session.error:
        ui.label(session.error).classes("trouble").props('role="alert"')
    if session.note:
        ui.label(session.note).classes("soft small")
    if len(session.chosen) > 1:
        with row():
            for name in session.chosen:
                look = ui.button(name, on_click=partial(session.look_at, name), color=None)
                look.props("flat no-caps").classes("main" if name == session.active else "plain")
    is_left = session.trials.file("fit").is_file() and session.results.fit is None
    if is_left and not session.error and tab.stage in ("compare", "diagnose", "predict"):
        ui.label("Opening the run …").classes("soft")
    PANELS[tab.stage](tab)


def _figure(tab: Tab) -> Any:
    """The curves below the video."""
    session, found, stage, dark = tab.session, tab.session.results, tab.stage, tab.dark
    motion, track = session.motion, found.tracks.get(session.active)
    if stage == "track" or motion is None:
        if track is None or session.sheet is None or stage in ("explain", "video", "marks"):
            return None
        end_s = session.sheet.info.frame_count / session.sheet.marks.fps
        return charts.track_figure(track, dark, end_s)
    if stage in ("compare", "diagnose"):
        extra = _candidate(tab) if stage == "diagnose" else None
        return charts.residual_figure(motion, session.stretches, dark, extra)
    ahead = (found.prediction or {"clips": {}})["clips"].get(session.active)
    if stage == "predict" and ahead is not None:
        return charts.prediction_figure(ahead, dark)
    return charts.fit_figure(motion, dark) if stage in ("explain", "fit", "predict") else None


def _candidate(tab: Tab) -> tuple[str, Any] | None:
    """The name of the candidate that is looked at and its curve, where the model lacks it."""
    found = tab.session.results.diagnosis
    known = found["curves"] if found is not None else tab.session.results.previews
    curves = known.get(tab.candidate, ())
    own = [one for one in curves if one["clip"] == tab.session.active]
    is_in = set(tab.candidate.split("+")) <= set(tab.session.effects)
    return (tab.candidate, own[0]) if own and not is_in else None
