"""The films and tables of a folder, which of them are chosen, and their marks."""

from collections import Counter
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from galileo_jax.runtime.errors import InputError
from galileo_jax.studio.clip_state import Sheet, Table, changed, opened, redone, undone
from galileo_jax.studio.frames import frames_of
from galileo_jax.studio.marks import Marks
from galileo_jax.studio.paths import clips
from galileo_jax.studio.stages import Trials
from galileo_jax.studio.store import Store

MOST_AT_ONCE = 12  # videos of a folder that are decoded before the page opens


class Clips:
    """The clips of a folder; a film is decoded when it is turned to, the first ones at once."""

    def __init__(self, root: Path):
        self.root, self.store = root.resolve(), Store(root)
        self.sheets: dict[str, Sheet | Table] = {}
        self.broken: dict[str, str] = {}
        self.active = ""
        self.chosen: tuple[str, ...] = ()
        self.error = ""
        self.seen: Mapping[str, Any] | None = None  # what is understood of the active clip
        self.versions: Counter[str] = Counter()
        self._unopened: dict[str, Path] = {}

    def scan(self) -> None:
        """Looks at the folder again; a video is decoded once to know it, the first ones now."""
        for name, path in clips(self.root).items():
            if name not in self.sheets:
                self._unopened[name] = path
                if len(self.sheets) < MOST_AT_ONCE:
                    self._open(name)
        self._changed("clips")

    @property
    def names(self) -> tuple[str, ...]:
        """Of all clips that can be shown."""
        return tuple(sorted({*self.sheets, *self._unopened}))

    def _open(self, name: str) -> bool:
        path = self._unopened.pop(name, None)
        if path is not None:
            try:
                self.sheets[name] = opened(self.root, path, self.store)
                self.broken.pop(name, None)
            except InputError as error:
                self.broken[name] = str(error).replace(f"{path}: ", "")
                self._changed("clips")
        return name in self.sheets

    def _read_again(self, name: str) -> None:
        """A clip's yaml as somebody else has left it."""
        if isinstance(sheet := self.sheets.get(name), Sheet):
            self.sheets[name] = opened(self.root, sheet.source, self.store)

    @property
    def sheet(self) -> Sheet | None:
        """The active clip's; None where that is a table."""
        found = self.sheets.get(self.active)
        return found if isinstance(found, Sheet) else None

    @property
    def trials(self) -> Trials:
        """The chosen clips."""
        return Trials(self.root, tuple(self.sheets[name] for name in self.chosen))

    def picture(self, name: str, index: int) -> bytes | None:
        """A frame of a clip, JPEG."""
        sheet = self.sheets.get(name)
        if not isinstance(sheet, Sheet):
            return None
        return frames_of(sheet.source).picture(index)

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

    def _changed(self, *parts: str) -> None:
        for part in parts:
            self.versions[part] += 1
