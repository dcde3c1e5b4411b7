"""What all tabs look at: the clips, their marks, the results, and the job that runs."""

import asyncio
import os
from collections import Counter
from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

from galileo_jax.clip.track_file import is_track
from galileo_jax.report.diagnosis_text import PROPOSED
from galileo_jax.results.stale_outputs import document
from galileo_jax.runtime.errors import InputError
from galileo_jax.studio import explained, results
from galileo_jax.studio.clip_state import (
    Sheet,
    Table,
    changed,
    opened,
    opened_table,
    redone,
    undone,
)
from galileo_jax.studio.frames import Frames
from galileo_jax.studio.job import Job
from galileo_jax.studio.jobs import Message, Worker
from galileo_jax.studio.marks import Marks
from galileo_jax.studio.marks_yaml import proposed
from galileo_jax.studio.paths import tables, videos
from galileo_jax.studio.shown import Results, with_partial
from galileo_jax.studio.stages import FILES, State, Trials, made, states, track_files, track_mark
from galileo_jax.studio.store import Store

MOST_AT_ONCE = 12  # videos of a folder that are decoded before the page opens
MOST_FRAMES = 4  # clips whose frames are held


class Session:
    """State of the studio; all of it is changed in the server's loop.

    `clip`: which of its clips is shown first, a table with its suffix; None: the first.
    """

    def __init__(self, root: Path, clip: str | None = None):
        self.root, self.store = root.resolve(), Store(root)
        self.sheets: dict[str, Sheet | Table] = {}
        self.broken: dict[str, str] = {}
        self.active = ""
        self.chosen: tuple[str, ...] = ()
        self.job: Job | None = None
        self.error = ""
        self.note = ""
        self.results = Results({})
        self.seen: Mapping[str, Any] | None = None  # what is understood of the active clip
        self.typed: dict[str, str] = {}  # answers to what is asked of it
        self._looking: int | None = None  # the question to the worker that is waited for
        self.versions: Counter[str] = Counter()
        self._frames: dict[str, Frames] = {}
        self._next: list[Callable[[], None]] = []
        self._loop: asyncio.AbstractEventLoop | None = None
        self._asked: Mapping[str, float] | None = None  # the sliders, while an answer is awaited
        self._waiting: Mapping[str, float] | None = None
        self._context: dict[str, Any] = {}
        self.worker = Worker(str(self.root), self._from_worker)
        self._effects_left: tuple[str, ...] = ()  # in the result that lies there
        self._unopened: dict[str, Path] = {}
        self.scan()
        if clip is not None and is_track(path := self.root / clip):
            self.add(path)
        else:
            is_known = clip in self.names or clip in self.broken
            self.show(clip if clip and is_known else next(iter(self.names), ""))

    # clips

    def scan(self) -> None:
        """Looks at the folder again; a video is decoded once to know it, the first ones now."""
        for name, path in {**tables(self.root), **videos(self.root)}.items():
            if name in self.sheets:
                continue
            self._unopened[name] = path
            if len(self.sheets) < MOST_AT_ONCE:
                self._open(name)
        self._changed("clips")

    @property
    def names(self) -> tuple[str, ...]:
        """Of all clips that can be shown."""
        return tuple(sorted({*self.sheets, *self._unopened}))

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

    def _open(self, name: str) -> bool:
        path = self._unopened.pop(name, None)
        if path is not None:
            try:
                if is_track(path):
                    self.sheets[name] = opened_table(self.root, path)
                else:
                    self.sheets[name] = opened(self.root, path, self.store)
                self.broken.pop(name, None)
            except InputError as error:
                self.broken[name] = str(error).replace(f"{path}: ", "")
                self._changed("clips")
        return name in self.sheets

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
    def sheet(self) -> Sheet | None:
        """The active clip's; None where that is a table."""
        found = self.sheets.get(self.active)
        return found if isinstance(found, Sheet) else None

    @property
    def trials(self) -> Trials:
        """The chosen clips."""
        return Trials(self.root, tuple(self.sheets[name] for name in self.chosen))

    @property
    def effects(self) -> tuple[str, ...]:
        """Of the fitted model, be it opened already or not."""
        if self.results.fit is not None:
            return tuple(self.results.fit["effects"])
        return self._effects_left

    @property
    def files(self) -> tuple[str, ...]:
        """Of effects of one's own that the last diagnosis was asked to try."""
        found = self.store.get("runs", self.trials.name).get("files", ())
        return tuple(str(name) for name in found if (self.root / str(name)).is_file())

    @property
    def states(self) -> dict[str, State]:
        """Of the stages."""
        return states(self.trials, self.store, self.effects)

    def picture(self, name: str, index: int) -> bytes | None:
        """A frame of a clip, JPEG."""
        sheet = self.sheets.get(name)
        if not isinstance(sheet, Sheet):
            return None
        if name not in self._frames:
            while len(self._frames) >= MOST_FRAMES:
                self._frames.pop(next(iter(self._frames)))
            self._frames[name] = Frames(sheet.source)
        return self._frames[name].picture(index)

    # marks

    def mark(self, marks: Marks) -> None:
        """Draws, and writes it to the yaml at once."""
        self._set_sheet(lambda sheet: changed(sheet, marks, self.store))

    def undo(self) -> None:
        """One step of the active clip's marks back."""
        self._set_sheet(lambda sheet: undone(sheet, self.store))

    def redo(self) -> None:
        """And forth."""
        self._set_sheet(lambda sheet: redone(sheet, self.store))

    def _set_sheet(self, change: Callable[[Sheet], Sheet]) -> None:
        if self.sheet is None:
            return
        try:
            self.sheets[self.active] = change(self.sheet)
            self.error = ""
        except (InputError, OSError) as error:
            self.error = " ".join(str(error).split())
        self.seen = None
        self._changed("marks", "job")

    # what is understood, and explained

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

    def explain(self) -> None:
        """Says what the chosen clips show: `galileo FILE` with the answers that were typed."""
        self._start("explain", clips=self.trials.files, typed=dict(self.typed), run=self._run)

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

    @property
    def answered(self) -> tuple[Sheet | Table, ...]:
        """The chosen clips whose yaml is what `explain` wrote there."""
        return explained.answered(self.trials, self.store)

    def report(self, name: str) -> str | None:
        """The page of a chosen clip's run, to be kept as one file; None: there is none."""
        return explained.report(self.trials, name) if name in self.chosen else None

    def still(self, name: str) -> bytes | None:
        """The picture of a chosen clip's prediction, PNG; None: there is none."""
        return explained.still(self.trials, name) if name in self.chosen else None

    def _read_again(self, name: str) -> None:
        """A clip's yaml as somebody else has left it."""
        if isinstance(sheet := self.sheets.get(name), Sheet):
            self.sheets[name] = opened(self.root, sheet.source, self.store)

    def _explained(self, trials: Trials, found: Mapping[str, Any]) -> None:
        """Remembers what was explained, for the page and for its parts."""
        explained.remember_answers(trials, self.store, self._context["undeclared"])
        for sheet in trials.sheets:
            self._read_again(sheet.name)
        now = Trials(self.root, tuple(self.sheets[one.name] for one in trials.sheets))
        self.store.put("runs", now.name, explained.entry(now, found))
        self.seen = None
        if now.name == self.trials.name:
            self._show_stored()

    # jobs

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
        trials, files = self.trials, self.files if effects else ()
        if is_law:
            files = (*files, f"{self._run}/diagnosis/{PROPOSED}")
        self._start(
            "fit",
            clips=trials.files,
            run=self._run,
            effects=list(effects),
            effects_from=list(files),
            of=trials.made_of(list(files)),
        )
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

    def close(self) -> None:
        """Ends the worker."""
        self.worker.close()

    @property
    def _run(self) -> str:
        return str(self.trials.run.relative_to(self.root))

    def _start(self, task: str, **given: Any) -> None:
        if self.job is not None:
            self.error = "Something is being computed; cancel it, or wait."
            self._changed("job")
            return
        self._loop = self._loop or asyncio.get_running_loop()
        self._next = []
        try:
            self.trials.run.resolve().relative_to(self.root)
            self.worker.start(task, **given)
        except (RuntimeError, ValueError) as error:
            self.error = f"{task}: {error}"
            self._changed("job")
            return
        trials = self.trials
        marks = {sheet.name: track_mark(sheet) for sheet in trials.sheets}
        effects = tuple(given.get("effects", self.effects))
        self._context = {
            "trials": trials, "tracks": marks, "clip": self.active,
            "of": {"marks": trials.made_of(), "model": trials.made_of(effects)},
            "undeclared": {one.name for one in trials.sheets if not one.yaml.is_file()},
        }  # fmt: skip
        self.job, self.error, self.note = Job(task), "", ""
        self._changed("job")

    def _from_worker(self, message: Message) -> None:
        if self._loop is not None and not self._loop.is_closed():
            self._loop.call_soon_threadsafe(self._receive, message)

    def _receive(self, message: Message) -> None:
        if message.task == "understand":
            self._understood(message)
        elif message.task in ("simulate", "open_run"):
            self._answered(message)
        elif message.kind == "progress":
            stage, share = message.content
            if self.job is not None:
                self.job = replace(self.job, stage=stage, share=share)
                self._changed("job")
        elif message.kind == "partial":
            self._partial(message.content)
        else:
            self._ended(message)

    def _understood(self, message: Message) -> None:
        if message.kind in ("progress", "partial") or message.job != self._looking:
            return
        self._looking = None
        self.seen = {"problem": message.content} if message.kind == "error" else message.content
        self._changed("clips")

    def _partial(self, content: Mapping[str, Any]) -> None:
        if self._context["trials"].name != self.trials.name:
            return
        self.results = with_partial(self.results, content)
        self._changed("live" if "frame" in content else "results")

    def _ended(self, message: Message) -> None:
        follow, self._next, self.job = self._next, [], None
        if message.task == "track" and message.kind != "done":
            self._set_results(tracks=self._tracks())  # as they were
        if message.task == "explain" and message.kind != "done":
            self._back()
        if message.kind == "done":
            self._record(message.task, message.content)
            for action in follow:
                action()
        elif message.kind == "cancelled":
            self.note = "Cancelled; what was finished before is saved."
        else:
            self.error = str(message.content)
        self._changed("job", "clips")

    def _record(self, task: str, content: Mapping[str, Any]) -> None:
        """Remembers what a result was made of, and shows it."""
        trials: Trials = self._context["trials"]
        of = self._context["of"]
        if task == "propose":
            self._propose(content["proposal"])
            return
        if task == "track":
            for sheet in trials.sheets:
                if isinstance(sheet, Table):
                    continue
                entry = self.store.get("clips", sheet.name)
                path = track_files(sheet) / "track_px.csv"
                mark = made(path, self._context["tracks"][sheet.name])
                self.store.put("clips", sheet.name, entry | {"tracked": mark})
            self._changed("results")
            return
        if task == "explain":
            self._explained(trials, content["explained"])
            return
        if task == "export":
            self.note = "Written: " + ", ".join(content["files"])
            return
        entry = self.store.get("runs", trials.name)
        mark = of["marks"] if task in ("fit", "diagnose") else of["model"]
        path = trials.file(task)
        if path.is_file():
            entry[task] = made(path, mark)
        if task == "fit":
            new = results.round_of(document(trials.run / "result.json"))
            is_shown = trials.name == self.trials.name  # with rounds that commands have left
            known = entry.get("rounds") or (list(self.results.rounds) if is_shown else [])
            entry["rounds"] = results.with_round(known, new)
        if task in ("compare", "predict"):
            key = {"compare": "compare", "predict": "prediction"}[task]
            entry[f"{task}_view"] = content[key]
        if task == "compare" and entry.get("rounds"):
            entry["rounds"][-1]["p_value"] = content["compare"]["p_value"]
        if task == "diagnose":
            entry["diagnose_view"] = content["diagnosis"]
        self.store.put("runs", trials.name, entry)
        if trials.name == self.trials.name:
            self._show_stored()

    def _propose(self, found: Mapping[str, Any]) -> None:
        sheet = self.sheets.get(self._context["clip"])
        if not isinstance(sheet, Sheet) or sheet.is_drawn:
            return
        marks = proposed(found, sheet.info.size_px)
        self.sheets[sheet.name] = changed(sheet, marks, self.store)
        self.note = " ".join(found.get("doubts", ()))
        self._changed("marks")

    def _answered(self, message: Message) -> None:
        if message.kind == "progress":
            return
        if message.task == "open_run":
            if message.kind == "done" and self.results.fit is None:
                self._set_results(fit=message.content["fit"])
            elif message.kind == "error":
                self.error = str(message.content)
                self._changed("job")
            return
        self._asked, waiting, self._waiting = None, self._waiting, None
        if message.kind == "done":
            self._set_results(live=message.content)
        if waiting is not None:
            self.move_model(waiting)

    # results

    def put_back(self) -> None:
        """The model at its best fit again."""
        self._set_results(live=None)

    def _reopen(self) -> None:
        """Shows what lies in the folder for the clips that are chosen now."""
        self.results, self.seen, self._looking = Results(self._tracks()), None, None
        self.typed = {}
        self._show_stored()
        self._changed("clips", "marks", "results", "job")

    def _tracks(self) -> dict[str, Any]:
        """Those that lie in the folder, by clip."""
        tracks = {}
        for sheet in self.trials.sheets:
            view = results.pixel_track(track_files(sheet) / "track_px.csv")
            if view is not None:
                tracks[sheet.name] = {**view, "clip": sheet.name}
        return tracks

    def _show_stored(self) -> None:
        run = self.trials.run
        entry = self.store.get("runs", self.trials.name)
        fitted = document(run / FILES["fit"]).get("effects")
        self._effects_left = tuple(map(str, fitted)) if isinstance(fitted, list) else ()
        found = document(run / FILES["diagnose"])
        last = entry.get("diagnose", {}).get("at") if found else None
        is_own = found and last == (run / FILES["diagnose"]).stat().st_mtime_ns  # not a command's
        curves = entry.get("diagnose_view", {}).get("curves", {}) if is_own else {}
        diagnosis = {"sentence": "", **found, "curves": curves}
        self._set_results(
            **explained.told(self.trials, entry),
            compare=entry.get("compare_view") if (run / FILES["compare"]).is_file() else None,
            prediction=self._prediction(entry),
            diagnosis=diagnosis if found else None,
            candidates=tuple(found.get("candidates", ())),
            rounds=tuple(self._rounds(entry.get("rounds") or list(found.get("history", ())))),
        )

    def _prediction(self, entry: Mapping[str, Any]) -> Mapping[str, Any] | None:
        found = entry.get("predict_view", {})
        is_there = self.trials.file("predict").is_file() and "clips" in found
        return found if is_there else None

    def _rounds(self, known: list[dict[str, Any]]) -> list[dict[str, Any]]:
        """With that of the fit that lies there, whoever made it."""
        try:
            last = results.round_of(document(self.trials.run / FILES["fit"]))
        except (KeyError, TypeError):
            return known
        is_last = bool(known) and set(known[-1]["effects"]) == set(last["effects"])
        return known if is_last else results.with_round(known, last)

    def open_run(self, is_pressed: bool = False) -> None:
        """Loads the chosen clips' fit, if there is one.

        One whose effects come from a program is loaded only where somebody has pressed for it.
        """
        run = self.trials.run
        if self.results.fit is not None or not (run / "result.json").is_file():
            return
        self._loop = self._loop or asyncio.get_running_loop()
        try:
            results.check_run(self.root, run, may_run=is_pressed)
        except InputError as error:
            self.error = " ".join(str(error).split())
            self._changed("job")
            return
        self.worker.ask("open_run", run=os.path.relpath(run, self.root))

    def _set_results(self, **given: Any) -> None:
        self.results = replace(self.results, **given)
        self._changed("live" if set(given) == {"live"} else "results")

    def _changed(self, *parts: str) -> None:
        for part in parts:
            self.versions[part] += 1
