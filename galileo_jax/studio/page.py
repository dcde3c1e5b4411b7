"""The page of one tab: the stages above, the video and its curves left, the stage's panel right."""

import asyncio
import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

from nicegui import ui

from galileo_jax.studio import charts
from galileo_jax.studio.marks import Marks, corrected, moved, with_object
from galileo_jax.studio.panels import compare, diagnose, explain, fit, marks, predict, track, video
from galileo_jax.studio.session import Session
from galileo_jax.studio.stages import STAGES
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


@dataclass
class Tab:
    """What one tab shows; the session is the same for all.

    Attributes:
      session: the clips and results.
      stage: the panel.
      candidate: whose curve is looked at.
      placing: what a click into the video places: a new object, or one that is put right; "":
        nothing.
      frame: that is shown.
      is_writing, draft: whether an effect is being written, and its text; None: as saved.
      dark: the colours.
      said: the job, the error and the note that are shown.
      drawn, lamps: what the panel and the row of stages were built of.
      refresh: does that.
      redraw: shows everything anew.
      redraw_curves: only the video and what is below it.
    """

    session: Session
    stage: str = "explain"
    candidate: str = ""
    placing: str = ""
    frame: int = 0
    is_writing: bool = False
    draft: str | None = None
    dark: bool = False
    said: tuple[str, str, str] = ("", "", "")
    drawn: Any = None
    lamps: Any = None
    refresh: Callable[[], None] = lambda: None
    redraw: Callable[[], None] = lambda: None
    redraw_curves: Callable[[], None] = lambda: None

    def go(self, stage: str) -> None:
        """Turns to a stage."""
        if self.stage == "fit" != stage and self.session.results.live is not None:
            self.session.put_back()
        self.stage, self.candidate, self.placing = stage, "", ""
        if stage in ("fit", "compare", "diagnose", "predict"):
            self.session.open_run()
        if stage == "marks":
            self.session.propose_once()
        self.redraw()

    def mark(self, marks: Marks) -> None:
        """Draws, and shows it in this tab at once: what is typed next must not be swept away."""
        self.session.mark(marks)
        self.redraw()

    def change(self, **given: Any) -> None:
        """Draws the active clip's marks with other values."""
        if self.session.sheet is not None:
            self.mark(replace(self.session.sheet.marks, **given))

    def preview(self, candidate: str) -> None:
        """Looks at a candidate's curve."""
        if candidate != self.candidate:
            self.candidate = candidate
            self.redraw_curves()  # and not the panel: a click that follows must find its button


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
        dark = ui.dark_mode(None)
        with ui.element("header").classes("bar"):
            ui.label("galileo studio").classes("brand")
            self._stages = ui.element("nav").classes("stages").props('aria-label="stages"')
            with ui.element("div").classes("end"):
                _icon("undo", "Undo", self._session.undo)
                _icon("redo", "Redo", self._session.redo)
                _icon("contrast", "Light or dark", lambda: _turn(tab, dark, self.show))
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
        self._viewer.on("frame", self._on_frame)

    def _on_moved(self, event: Any) -> None:
        sheet, given = self._session.sheet, event.args
        if sheet is not None:
            self._tab.mark(moved(sheet.marks, given["handle"], (given["x"], given["y"])))

    def _on_place(self, event: Any) -> None:
        tab, sheet = self._tab, self._session.sheet
        if sheet is None or not tab.placing:
            return
        (x, y, frame), name, tab.placing = event.args, tab.placing, ""
        if name == explain.POINTS:
            self._session.say(name, f"{x:.0f} {y:.0f}")
            self.show()
        elif name == marks.NEW:
            tab.mark(with_object(sheet.marks, (x, y)))
        else:
            tab.mark(corrected(sheet.marks, name, int(frame), (x, y)))
            self._session.track()

    def _on_frame(self, event: Any) -> None:
        self._tab.frame = int(event.args)

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
        tab, job = self._tab, self._session.job
        now = (tab.stage, job.task if job else "", *self._session.states.values())
        if now == tab.lamps:
            return
        tab.lamps = now
        self._stages.clear()
        with self._stages:
            _stage_buttons(tab)

    def curves(self) -> None:
        """Shows the video and what is below it anew."""
        self._viewer.show(self._session, self._tab.stage, bool(self._tab.placing))
        figure = _figure(self._tab)
        self._strip.classes(add="" if figure else "none", remove="none" if figure else "")
        if figure is not None and figure != self._figure:
            self._chart.update_figure(figure)
            self._figure = figure

    def _bar(self) -> None:
        self._job.clear()
        if self._session.job is not None:
            with self._job:
                _job_bar(self._session)

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
        session.error, session.note, session.job is None, tuple(session.states.values()),
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


def _stage_buttons(tab: Tab) -> None:
    states = tab.session.states
    running = ""
    if tab.session.job is not None:
        running = RUNNING.get(tab.session.job.task, tab.session.job.task)
    for stage, title in STAGES.items():
        state = "running" if stage == running else states[stage]
        button = (
            ui.element("button").classes("stagebutton").props(f"type=button data-stage={stage}")
        )
        if stage == tab.stage:
            button.props('aria-current="step"')
        if states[stage] == "locked":
            button.props("disabled")
        button.props(f'title="{title}: {_WORDS[state]}" data-state="{state}"')
        button.on("click", partial(tab.go, stage))
        with button:
            ui.element("span").classes(f"lamp {state}")
            ui.label(title)


_WORDS = {
    "locked": "waiting for the step before it",
    "open": "to do",
    "done": "done",
    "stale": "made with earlier marks",
    "running": "running",
}


def _panel(tab: Tab) -> None:
    session = tab.session
    if session.error:
        ui.label(session.error).classes("trouble").props('role="alert"')
    if session.note:
        ui.label(session.note).classes("soft small")
    if len(session.chosen) > 1:
        with ui.element("div").classes("rowline"):
            for name in session.chosen:
                look = "main" if name == session.active else "plain"
                ui.button(name, on_click=partial(session.look_at, name), color=None).props(
                    "flat no-caps"
                ).classes(look)
    is_left = (session.trials.run / "result.json").is_file() and session.results.fit is None
    if is_left and not session.error and tab.stage in ("compare", "diagnose", "predict"):
        ui.label("Opening the run …").classes("soft")
    PANELS[tab.stage](tab)


def _figure(tab: Tab) -> Any:
    """The curves below the video."""
    found, dark = tab.session.results, tab.dark
    motion = Viewer.motion(tab.session)
    if tab.stage == "track" or motion is None:
        track = found.tracks.get(tab.session.active)
        is_wanted = tab.stage not in ("explain", "video", "marks")
        if track is None or not is_wanted or tab.session.sheet is None:
            return None
        count = tab.session.sheet.info.frame_count
        return charts.track_figure(track, dark, count / tab.session.sheet.marks.fps)
    if tab.stage in ("explain", "fit"):
        return charts.fit_figure(motion, dark)
    is_of_this_model = found.compare is not None and tab.session.states["compare"] == "done"
    stretches = found.compare["stretches"] if found.compare and is_of_this_model else ()
    own = [one for one in stretches if one["clip"] == tab.session.active]
    if tab.stage == "compare":
        return charts.residual_figure(motion, own, dark)
    if tab.stage == "diagnose":
        return charts.residual_figure(motion, own, dark, _candidate(tab))
    ahead = (found.prediction or {"clips": {}})["clips"].get(tab.session.active)
    if tab.stage == "predict" and ahead is not None:
        return charts.prediction_figure(ahead, dark)
    return charts.fit_figure(motion, dark) if tab.stage == "predict" else None


def _candidate(tab: Tab) -> tuple[str, Any] | None:
    results = tab.session.results
    found = results.diagnosis
    known = found["curves"] if found is not None else results.previews
    curves = known.get(tab.candidate, ())
    own = [one for one in curves if one["clip"] == tab.session.active]
    is_in = set(tab.candidate.split("+")) <= set(tab.session.effects)
    return (tab.candidate, own[0]) if own and not is_in else None


def _job_bar(session: Session) -> None:
    job = session.job
    assert job is not None
    with ui.element("div").classes("job").props('role="status"'):
        text = "stopping" if job.is_cancelled else job.stage
        left = job.time_left(time.monotonic())
        said = ", ".join(filter(None, (text, left)))
        ui.label(f"{STAGES.get(job.task, 'Looking')}: {said}").classes("small")
        with ui.element("div").classes("meter"):
            ui.element("i").style(f"width: {100 * job.share:.0f}%")
        if not job.is_cancelled:
            ui.button("Cancel", on_click=session.cancel, color=None).props("flat no-caps")


def _icon(name: str, title: str, action: Callable[[], Any]) -> None:
    button = ui.button(icon=name, on_click=action, color=None).props("flat round").classes("icon")
    button.props(f'aria-label="{title}" title="{title}"')


def _turn(tab: Tab, dark: Any, show: Callable[[], None]) -> None:
    tab.dark = not tab.dark
    dark.value = tab.dark
    show()
