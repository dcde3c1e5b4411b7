"""Progress of long work on stderr: a bar in a terminal, a plain line now and then in a pipe."""

import sys
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

from galileo_jax.commands import command
from galileo_jax.runtime.progress import OnProgress

if TYPE_CHECKING:
    from rich.progress import Progress

FIRST_LINE_S, NEXT_LINE_S = 5.0, 15.0  # in a pipe, since the start and since the line before


class ProgressDisplay:
    """What the public functions take as `on_progress`."""

    def __init__(self, bar: "Progress | None"):
        self._bar = bar
        self._task = bar.add_task("starting", total=1.0) if bar is not None else None
        self._begun = self._next_line = time.monotonic()
        self._next_line += FIRST_LINE_S

    def __call__(self, stage: str, share_done: float, partial: Any = None) -> None:
        """Shows a stage and the share of the whole work that is done."""
        if self._bar is not None and self._task is not None:
            self._bar.update(self._task, description=stage, completed=share_done)
            return
        now = time.monotonic()
        if now >= self._next_line:
            self._next_line = now + NEXT_LINE_S
            spent = f"{now - self._begun:.0f} s"
            print(f"{stage}: {100 * share_done:.0f} % done, {spent}", file=sys.stderr, flush=True)

    def showing(self, show: Callable[[Mapping[str, Any]], None]) -> OnProgress:
        """The same, with `show` called with what there is of the result, where it is a mapping."""

        def on_progress(stage: str, share_done: float, partial: Any) -> None:
            self(stage, share_done)
            if isinstance(partial, dict):
                show(partial)

        return on_progress

    def print(self, line: str) -> None:
        """Prints a line of the result to stdout, which a live bar would swallow."""
        if self._bar is not None:
            self._bar.stop()
        print(line, flush=True)
        if self._bar is not None:
            self._bar.start()


@contextmanager
def progress_display() -> Iterator[ProgressDisplay]:
    """Shows progress for as long as the context is open."""
    console = command.console()
    if not console.is_terminal:
        yield ProgressDisplay(None)
        return
    from rich.progress import (
        BarColumn,
        Progress,
        TaskProgressColumn,
        TextColumn,
        TimeElapsedColumn,
    )

    columns = (TextColumn("{task.description}"), BarColumn(), TaskProgressColumn())
    with Progress(*columns, TimeElapsedColumn(), console=console, transient=True) as bar:
        yield ProgressDisplay(bar)
