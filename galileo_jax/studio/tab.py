"""What one tab of the browser shows; the session is the same for all."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

from galileo_jax.studio.marks import Marks
from galileo_jax.studio.session import Session


@dataclass
class Tab:
    """What one tab shows."""

    session: Session  # the clips and results
    stage: str = "explain"  # the panel
    candidate: str = ""  # whose curve is looked at
    # What a click into the video places: a new object, or one that is put right; "": nothing.
    placing: str = ""
    frame: int = 0  # that is shown
    # Whether an effect is being written, and its text; None: as saved.
    is_writing: bool = False
    draft: str | None = None
    dark: bool = False  # the colours
    said: tuple[str, str, str] = ("", "", "")  # the job, the error and the note that are shown
    # What the panel and the row of stages were built of.
    drawn: Any = None
    lamps: Any = None
    refresh: Callable[[], None] = lambda: None  # brings the panel up to date
    redraw: Callable[[], None] = lambda: None  # shows everything anew
    redraw_curves: Callable[[], None] = lambda: None  # only the video and what is below it

    @property
    def is_idle(self) -> bool:
        """Whether nothing is computed."""
        return self.session.job is None

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

    def go_on(self, stage: str, action: Callable[[], None]) -> None:
        """Turns to a stage and begins what is done there."""
        self.go(stage)
        action()

    def mark(self, marks: Marks) -> None:
        """Draws, and shows it in this tab at once: what is typed next must not be swept away."""
        self.session.mark(marks)
        self.redraw()

    def edit(self, change: Callable[..., Marks], *given: Any, **more: Any) -> None:
        """Draws the active clip's marks as `change(marks, *given, **more)` makes them."""
        if self.session.sheet is not None:
            self.mark(change(self.session.sheet.marks, *given, **more))

    def change(self, **given: Any) -> None:
        """Draws the active clip's marks with other values."""
        self.edit(lambda marks: replace(marks, **given))

    def place(self, what: str) -> None:
        """What the next click into the video places; once more: nothing."""
        self.placing = "" if self.placing else what
        self.redraw()

    def preview(self, candidate: str) -> None:
        """Looks at a candidate's curve."""
        if candidate != self.candidate:
            self.candidate = candidate
            self.redraw_curves()  # and not the panel: a click that follows must find its button
