"""What all tabs look at: the clips, their marks, the results, and the job that runs."""

import asyncio
import os
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from galileo_jax.clip.file_kinds import is_track
from galileo_jax.report.diagnosis_text import PROPOSED
from galileo_jax.results.stale_outputs import document
from galileo_jax.runtime.errors import InputError
from galileo_jax.studio import results
from galileo_jax.studio.clip_state import Sheet, Table, changed
from galileo_jax.studio.clips import Clips
from galileo_jax.studio.jobs import Job, Message, Worker
from galileo_jax.studio.marks_yaml import proposed
from galileo_jax.studio.results import Results, with_partial
from galileo_jax.studio.stages import (
    State,
    Trials,
    made,
    states,
    track_files,
    track_mark,
)

VIEWED = ("compare", "diagnose", "predict")  # whose results are not all in their files


@dataclass(frozen=True)
class Begun:
    """What a job was begun with."""

    trials: Trials
    clip: str  # the active one
    tracks: Mapping[str, str]  # by clip what its track is made of
    # What a result is made of, by task: that of the model, or of the marks alone.
    of: Mapping[str, str]
    undeclared: frozenset[str]  # clips without a yaml


class Session(Clips):
    """State of the studio; all of it is changed in the server's loop.

    `clip`: which of its clips is shown first, a table with its suffix; None: the first.
    """

    def __init__(self, root: Path, clip: str | None = None):
        super().__init__(root)
        self.job: Job | None = None
        self.note = ""
        self.results = Results({})
        self.typed: dict[str, str] = {}  # answers to what is asked of the active clip
        self._looking: int | None = None  # the question to the worker that is waited for
        self._next: list[Callable[[], None]] = []
        self._loop: asyncio.AbstractEventLoop | None = None
        self._asked: Mapping[str, float] | None = None  # the sliders, while an answer is awaited
        self._waiting: Mapping[str, float] | None = None
        self._begun: Begun | None = None
        self.worker = Worker(str(self.root), self._from_worker)
        self.scan()
        if clip is not None and is_track(path := self.root / clip):
            self.add(path)
        else:
            is_known = clip in self.names or clip in self.broken
            self.show(clip if clip and is_known else next(iter(self.names), ""))

    # clips

    def add(self, path: Path) -> None:
        """Takes in a film, a table or a yaml that was opened or dropped, and turns to it."""
        self.scan()
        if is_track(path):
            self.sheets.pop(path.stem, None)
            self._unopened[path.stem] = path
        if path.stem in self.names:
            self._read_again(path.stem)
            self.show(path.stem)
        self._changed("opened")

    def show(self, name: str) -> None:
        """Turns to one clip, alone."""
        if self._open(name):
            self.active, self.chosen = name, (name,)
            self._reopen()

    def choose(self, names: tuple[str, ...]) -> None:
        """Which clips are trials of the same objects; the active one is among them."""
        chosen = tuple(name for name in self.names if name in names and self._open(name))
        if chosen:
            self.chosen = chosen
            self.active = self.active if self.active in chosen else chosen[0]
            self._reopen()

    def look_at(self, name: str) -> None:
        """Which of the chosen clips is drawn."""
        if name in self.chosen and name != self.active:
            self.active = name
            self._changed("clips", "marks", "results")

    @property
    def states(self) -> dict[str, State]:
        """Of the stages."""
        return states(self.trials, self.store, self.effects)

    # what is understood

    def understand(self) -> None:
        """Looks at the active clip, where that has not been done, to say what it shows."""
        if self.active and self.seen is None and self._looking is None and self.job is None:
            self._look()

    def say(self, key: str, text: str) -> None:
        """Takes an answer to a question, as it is typed."""
        self.typed[key] = text
        self._look()

    def _look(self) -> None:
        self._loop = self._loop or asyncio.get_running_loop()
        name = self.sheets[self.active].source.name
        self._looking = self.worker.ask("understand", clip=name, typed=dict(self.typed))

    @property
    def answered(self) -> tuple[Sheet | Table, ...]:
        """The chosen clips whose yaml is what `explain` wrote there of a person's answers."""
        return tuple(
            sheet
            for sheet in self.trials.sheets
            if (text := self.store.get("clips", sheet.name).get("answered"))
            and sheet.yaml.is_file()
            and sheet.yaml.read_text(encoding="utf-8") == text
        )

    def answer_anew(self) -> None:
        """Asks again what was asked: what `explain` wrote to the yaml is taken back."""
        for sheet in self.answered:
            sheet.yaml.unlink()
        self._back()

    def _back(self) -> None:
        """To what lies in the folder; what was typed stays."""
        typed = self.typed
        for sheet in self.trials.sheets:
            self._read_again(sheet.name)
        self._reopen()
        self.typed = typed

    # jobs

    def explain(self) -> None:
        """Says what the chosen clips show: `galileo FILE` with the answers that were typed."""
        self._start("explain", clips=self.trials.files, typed=dict(self.typed), run=self._run)

    def propose_once(self) -> None:
        """Does what `propose` does, where nothing is drawn yet and nothing is computed."""
        if self.sheet is not None and not self.sheet.is_drawn and self.job is None:
            self.propose()

    def propose(self) -> None:
        """Looks for the objects and the ramp of a clip that has no marks."""
        if self.sheet is not None:
            self._start("propose", video=self.sheet.source.name)

    def track(self) -> None:
        """Tracks the chosen clips."""
        self._start("track", clips=self.trials.files)

    def fit(self, effects: tuple[str, ...] = (), is_law: bool = False) -> None:
        """Fits a model with these effects, then compares it with the data.

        `is_law`: whether one is the formula that the diagnosis proposes, in a file of its
        own.
        """
        found = self.store.get("runs", self.trials.name).get("files", ()) if effects else ()
        files = [str(name) for name in found if (self.root / str(name)).is_file()]  # one's own
        if is_law:
            files.append(f"{self._run}/diagnosis/{PROPOSED}")
        self._start(
            "fit", clips=self.trials.files, run=self._run, effects=list(effects),
            effects_from=files, of=self.trials.made_of(files),
        )  # fmt: skip
        self._next = [self.compare]

    def compare(self) -> None:
        """Where does the model fail?"""
        self._start("compare", run=self._run)

    def diagnose(self, files: tuple[str, ...] = ()) -> None:
        """Which effect is missing?"""
        entry = self.store.get("runs", self.trials.name)
        self.store.put("runs", self.trials.name, entry | {"files": list(files)})
        self._set_results(candidates=(), diagnosis=None, previews={})
        self._start("diagnose", clips=self.trials.files, run=self._run, effects_from=list(files))

    def predict(self, seconds: float) -> None:
        """Where does it go?"""
        self._start("predict", run=self._run, seconds=seconds)

    def export(self, to: str) -> None:
        """Writes the run for other programs."""
        self._start("export", run=self._run, to=to)

    def cancel(self) -> None:
        """Stops the job between two batches."""
        if self.job is not None:
            self._next = []
            self.job = replace(self.job, is_cancelled=True)
            self.worker.cancel()
            self._changed("job")

    def move_model(self, values: Mapping[str, float]) -> None:
        """Puts the model's parameters somewhere else; the last of many wins."""
        if self._asked is not None:
            self._waiting = dict(values)
        elif self.results.fit is not None:
            self._asked = dict(values)
            self.worker.ask("simulate", run=self._run, values=self._asked)

    def open_run(self, is_pressed: bool = False) -> None:
        """Loads the chosen clips' fit, if there is one.

        One whose effects come from a program is loaded only where somebody has pressed for it.
        """
        run = self.trials.run
        if self.results.fit is not None or not self.trials.file("fit").is_file():
            return
        self._loop = self._loop or asyncio.get_running_loop()
        try:
            results.check_run(self.root, run, may_run=is_pressed)
        except InputError as error:
            self._fail(" ".join(str(error).split()))
            return
        self.worker.ask("open_run", run=os.path.relpath(run, self.root))

    def close(self) -> None:
        """Ends the worker."""
        self.worker.close()

    @property
    def _run(self) -> str:
        return str(self.trials.run.relative_to(self.root))

    def _fail(self, error: str) -> None:
        self.error = error
        self._changed("job")

    def _start(self, task: str, **given: Any) -> None:
        if self.job is not None:
            self._fail("Something is being computed; cancel it, or wait.")
            return
        self._loop = self._loop or asyncio.get_running_loop()
        self._next = []
        trials = self.trials
        try:
            trials.run.resolve().relative_to(self.root)
            self.worker.start(task, **given)
        except (RuntimeError, ValueError) as error:
            self._fail(f"{task}: {error}")
            return
        marks, model = trials.made_of(), trials.made_of(tuple(given.get("effects", self.effects)))
        self._begun = Begun(
            trials,
            self.active,
            tracks={sheet.name: track_mark(sheet) for sheet in trials.sheets},
            of={"fit": marks, "diagnose": marks, "compare": model, "predict": model},
            undeclared=frozenset(one.name for one in trials.sheets if not one.yaml.is_file()),
        )
        self.job, self.error, self.note = Job(task), "", ""
        self._changed("job")

    # what the worker says

    def _from_worker(self, message: Message) -> None:
        if self._loop is not None and not self._loop.is_closed():
            self._loop.call_soon_threadsafe(self._receive, message)

    def _receive(self, message: Message) -> None:
        is_over = message.kind not in ("progress", "partial")
        if message.task == "understand":
            if is_over and message.job == self._looking:
                self._looking = None
                problem = {"problem": message.content}
                self.seen = problem if message.kind == "error" else message.content
                self._changed("clips")
        elif message.task == "simulate":
            if is_over:
                self._simulated(message)
        elif message.task == "open_run":
            if message.kind == "done" and self.results.fit is None:
                self._set_results(fit=message.content["fit"])
            elif message.kind == "error":
                self._fail(str(message.content))
        elif is_over:
            self._ended(message)
        elif message.kind == "partial":
            if self._begun is not None and self._begun.trials.name == self.trials.name:
                self.results = with_partial(self.results, message.content)
                self._changed("live" if "frame" in message.content else "results")
        elif self.job is not None:
            stage, share = message.content
            self.job = replace(self.job, stage=stage, share=share)
            self._changed("job")

    def _simulated(self, message: Message) -> None:
        self._asked, waiting, self._waiting = None, self._waiting, None
        if message.kind == "done":
            self._set_results(live=message.content)
        if waiting is not None:
            self.move_model(waiting)

    def _ended(self, message: Message) -> None:
        follow, self._next, self.job = self._next, [], None
        if message.kind == "done" and self._begun is not None:
            self._record(message.task, message.content, self._begun)
            for action in follow:
                action()
        elif message.kind == "cancelled":
            self.note = "Cancelled; what was finished before is saved."
        else:
            self.error = str(message.content)
        if message.kind != "done" and message.task == "track":
            self._set_results(tracks=results.tracks(self.trials))  # as they were
        if message.kind != "done" and message.task == "explain":
            self._back()
        self._changed("job", "clips")

    def _record(self, task: str, content: Mapping[str, Any], begun: Begun) -> None:
        """Remembers what a result was made of, and shows it."""
        match task:
            case "propose":
                self._propose(content["proposal"], begun.clip)
            case "track":
                for sheet in begun.trials.sheets:
                    if isinstance(sheet, Sheet):
                        path = track_files(sheet) / "track_px.csv"
                        mark = made(path, begun.tracks[sheet.name])
                        self._remember(sheet.name, tracked=mark)
                self._changed("results")
            case "explain":
                self._explained(content["explained"], begun)
            case "export":
                self.note = "Written: " + ", ".join(content["files"])
            case _:
                self._computed(task, content, begun)

    def _remember(self, clip: str, **more: Any) -> None:
        self.store.put("clips", clip, self.store.get("clips", clip) | more)

    def _propose(self, found: Mapping[str, Any], clip: str) -> None:
        sheet = self.sheets.get(clip)
        if isinstance(sheet, Sheet) and not sheet.is_drawn:
            marks = proposed(found, sheet.info.size_px)
            self.sheets[clip] = changed(sheet, marks, self.store)
            self.note = " ".join(found.get("doubts", ()))
            self._changed("marks")

    def _explained(self, found: Mapping[str, Any], begun: Begun) -> None:
        """The comparison is of the model without effects: with some it is out of date."""
        for sheet in begun.trials.sheets:
            if sheet.name in begun.undeclared and sheet.yaml.is_file():
                self._remember(sheet.name, answered=sheet.yaml.read_text(encoding="utf-8"))
            self._read_again(sheet.name)
        now = Trials(self.root, tuple(self.sheets[one.name] for one in begun.trials.sheets))
        fitted = made(now.file("fit"), now.made_of())
        entry: dict[str, Any] = {
            "fit": fitted,
            "explained": {**fitted, "paragraph": found["paragraph"], "notes": found["notes"]},
            "compare": made(now.file("compare"), now.made_of(())),
            "compare_view": found["compare"],
        }
        if found["diagnosis"] is not None:
            entry["diagnose"] = made(now.file("diagnose"), now.made_of())
            entry["diagnose_view"] = found["diagnosis"]
        self.store.put("runs", now.name, entry)
        self.seen = None
        if now.name == self.trials.name:
            self._show_stored()

    def _computed(self, task: str, content: Mapping[str, Any], begun: Begun) -> None:
        trials, entry = begun.trials, self.store.get("runs", begun.trials.name)
        is_shown = trials.name == self.trials.name
        if trials.file(task).is_file():
            entry[task] = made(trials.file(task), begun.of[task])
        if task in VIEWED:
            entry[f"{task}_view"] = content["view"]
        if task == "fit":
            new = results.round_of(document(trials.file("fit")))
            known = entry.get("rounds") or (list(self.results.rounds) if is_shown else [])
            entry["rounds"] = results.with_round(known, new)  # and those that commands have left
        if task == "compare" and entry.get("rounds"):
            entry["rounds"][-1]["p_value"] = content["view"]["p_value"]
        self.store.put("runs", trials.name, entry)
        if is_shown:
            self._show_stored()

    # results

    @property
    def effects(self) -> tuple[str, ...]:
        """Of the fitted model, be it opened already or not."""
        fit = self.results.fit
        return self.results.effects if fit is None else tuple(fit["effects"])

    @property
    def motion(self) -> Mapping[str, Any] | None:
        """The active clip's motion, at the sliders where they were moved."""
        fit, live = self.results.fit, self.results.live
        for i, motion in enumerate(fit["motions"] if fit is not None else ()):
            if motion["clip"] == self.active:
                return {**motion, **(live["motions"][i] if live is not None else {})}
        return None

    @property
    def stretches(self) -> list[Mapping[str, Any]]:
        """Where the model fails in the active clip; empty while nobody knows of this model."""
        found = self.results.compare
        if found is None or self.states["compare"] != "done":
            return []
        return [one for one in found["stretches"] if one["clip"] == self.active]

    def put_back(self) -> None:
        """The model at its best fit again."""
        self._set_results(live=None)

    def _reopen(self) -> None:
        """Shows what lies in the folder for the clips that are chosen now."""
        self.results, self.seen, self._looking = Results(results.tracks(self.trials)), None, None
        self.typed = {}
        self._show_stored()
        self._changed("clips", "marks", "results", "job")

    def _show_stored(self) -> None:
        entry = self.store.get("runs", self.trials.name)
        self._set_results(**results.stored(self.trials, entry))

    def _set_results(self, **given: Any) -> None:
        self.results = replace(self.results, **given)
        self._changed("live" if set(given) == {"live"} else "results")
