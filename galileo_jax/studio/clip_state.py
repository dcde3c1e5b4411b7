"""One clip being marked: its marks, undo and redo, each step on disk before it is shown."""

from collections.abc import Mapping
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

from pydantic import TypeAdapter, ValidationError

from galileo_jax.api.label import label
from galileo_jax.api.understand import is_declared
from galileo_jax.clip.file_kinds import is_track
from galileo_jax.clip.label import updated_file
from galileo_jax.clip.load import check_clip
from galileo_jax.clip.yaml_file import read_mapping
from galileo_jax.runtime.atomic_write import write_text
from galileo_jax.runtime.errors import InputError
from galileo_jax.studio.check import Remark, remarks_on
from galileo_jax.studio.marks import Marks
from galileo_jax.studio.marks_yaml import blank, declared, labels
from galileo_jax.studio.paths import check_declared
from galileo_jax.studio.store import Store, yaml_content
from galileo_jax.video.decode import VideoInfo, probe

MOST_STEPS = 60  # that can be undone


@dataclass(frozen=True)
class Step:
    """Marks, the yaml that says so, and what was wrong with it."""

    marks: Marks  # as drawn
    yaml: str | None  # the text of NAME.yaml then; None: there was none
    # Why these marks could not be written to it; None: they are what it says.
    problem: str | None = None


@dataclass(frozen=True)
class History:
    """The marks now, and what undo and redo lead to, the nearest last."""

    present: Step
    past: tuple[Step, ...] = ()
    future: tuple[Step, ...] = ()


STORED = TypeAdapter(History)


@dataclass(frozen=True)
class Opened:
    """A clip that was opened."""

    root: Path
    source: Path

    @property
    def name(self) -> str:
        """The clip's, without suffix."""
        return self.source.stem

    @property
    def yaml(self) -> Path:
        """Where what is declared is written."""
        return self.source.with_suffix(".yaml")


@dataclass(frozen=True)
class Table(Opened):
    """A table: it has no pictures to mark."""

    @property
    def is_complete(self) -> bool:
        """Whether its yaml leaves nothing open."""
        try:
            return is_declared(self.source)
        except InputError:
            return False


@dataclass(frozen=True)
class Sheet(Opened):
    """A film with its marks."""

    info: VideoInfo
    history: History
    is_drawn: bool = True  # whether a person or a proposal has drawn anything yet

    @property
    def marks(self) -> Marks:
        """As drawn now."""
        return self.history.present.marks

    @property
    def remarks(self) -> tuple[Remark, ...]:
        """What is missing or odd."""
        if not self.is_drawn:
            return (Remark("missing", "Nothing is marked yet."),)
        return remarks_on(self.marks, self.info.container_fps, self.history.present.problem)

    @property
    def is_complete(self) -> bool:
        """Whether the clip can be tracked."""
        return self.yaml.is_file() and all(one.kind != "missing" for one in self.remarks)


def opened(root: Path, source: Path, store: Store) -> Sheet | Table:
    """A clip as it was left: of a film its yaml, and the marks that were drawn for it.

    Raises:
      InputError: the film does not decode, or the yaml names a file outside the folder.
    """
    path = source.with_suffix(".yaml")
    content = yaml_content(path)
    check_declared(root, source.parent, content)
    if is_track(source):
        return Table(root, source)
    info = probe(source)
    text = _read(path)
    kept = stored(store.get("clips", source.stem))
    if kept is not None and kept.present.yaml == text:
        return Sheet(root, source, info, kept)
    fps = info.container_fps or 30.0
    problem = None
    if text is not None:
        try:
            found = Step(declared(content, info.size_px, fps), text)
            # Somebody else has written it meanwhile.
            before = () if kept is None else (*kept.past, kept.present)
            return Sheet(root, source, info, History(found, before))
        except (KeyError, TypeError, ValueError, IndexError):
            problem = _problem_of(path)
    empty = Step(blank(fps, info.size_px), text, problem)
    return Sheet(root, source, info, History(empty), is_drawn=text is not None)


def changed(sheet: Sheet, marks: Marks, store: Store) -> Sheet:
    """The sheet with other marks, written to the yaml where they are valid."""
    if marks == sheet.marks and sheet.is_drawn:
        return sheet
    problem, history = _write(sheet, marks), sheet.history
    step = Step(marks, _read(sheet.yaml), problem)
    past = (*history.past, history.present)[-MOST_STEPS:] if sheet.is_drawn else history.past
    return _kept(replace(sheet, history=History(step, past), is_drawn=True), store)


def undone(sheet: Sheet, store: Store) -> Sheet:
    """One step back; the yaml is what it was then, comments included."""
    now = sheet.history
    if not now.past:
        return sheet
    *past, step = now.past
    return _restored(sheet, History(step, tuple(past), (*now.future, now.present)), store)


def redone(sheet: Sheet, store: Store) -> Sheet:
    """One step forth again."""
    now = sheet.history
    if not now.future:
        return sheet
    *future, step = now.future
    return _restored(sheet, History(step, (*now.past, now.present), tuple(future)), store)


def _restored(sheet: Sheet, history: History, store: Store) -> Sheet:
    if history.present.yaml is None:
        sheet.yaml.unlink(missing_ok=True)
    else:
        write_text(sheet.yaml, history.present.yaml)
    return _kept(replace(sheet, history=history), store)


def _write(sheet: Sheet, marks: Marks) -> str | None:
    """Writes marks to the yaml; what is wrong with them, if they cannot be."""
    before = None
    text = _read(sheet.yaml)
    if text is not None:  # relative to what the yaml says, not to what it refused
        steps = (sheet.history.present, *reversed(sheet.history.past))
        before = next((s.marks for s in steps if s.yaml == text and s.problem is None), None)
    try:
        if before is not None:
            _remove_objects(sheet, before, marks)
        if wanted := labels(before, marks):
            label(sheet.source, **wanted)
    except InputError as error:
        return said(error, sheet)
    return None


def _remove_objects(sheet: Sheet, before: Marks, after: Marks) -> None:
    kept = {one.name for one in after.objects}
    if all(one.name in kept for one in before.objects):
        return
    content = read_mapping(sheet.yaml)
    content["objects"] = [one for one in content["objects"] if one.get("name") in kept]
    check_clip(sheet.yaml, content)
    write_text(sheet.yaml, updated_file(sheet.yaml, content)[0])


def said(error: Exception, sheet: Sheet) -> str:
    """An error without the clip's own path, which the page shows anyway."""
    text = " ".join(str(error).split())
    for path in (sheet.yaml, sheet.source, sheet.yaml.name, sheet.source.name):
        text = text.removeprefix(f"{path}: ")
    return text[:1].upper() + text[1:]


def _kept(sheet: Sheet, store: Store) -> Sheet:
    store.put("clips", sheet.name, store.get("clips", sheet.name) | asdict(sheet.history))
    return sheet


def stored(entry: Mapping[str, Any]) -> History | None:
    """A history as it was stored; None where it is no such thing."""
    try:
        return STORED.validate_python(entry)
    except ValidationError:
        return None


def _problem_of(path: Path) -> str:
    try:
        read_mapping(path)
    except InputError as error:
        return str(error)
    return f"{path.name}: not a clip's yaml"


def _read(path: Path) -> str | None:
    try:
        return path.read_text(encoding="utf-8-sig")
    except (OSError, UnicodeDecodeError):
        return None
