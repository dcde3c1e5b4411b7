"""What every command shares: one-line errors, exit codes, progress."""

import argparse
import os
import sys
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any, NoReturn

from galileo_jax.commands.stop import STOPPED
from galileo_jax.runtime.errors import InputError
from galileo_jax.runtime.progress import OnProgress

if TYPE_CHECKING:
    from rich.console import Console
    from rich.progress import Progress

FIRST_LINE_S, NEXT_LINE_S = 5.0, 15.0  # in a pipe, since the start and since the line before


class Parser(argparse.ArgumentParser):
    """An argument parser whose errors are one line (an `InputError`), without the usage.

    Options are written out: `--effects` must not be taken for `--effects-from`.
    """

    def __init__(self, **given: Any):
        super().__init__(allow_abbrev=False, **given)

    def error(self, message: str) -> NoReturn:
        """Raises the complaint as an `InputError`."""
        raise InputError(f"{self.prog}: {message}; see --help")


def in_columns(known: Mapping[Any, Any]) -> str:
    """Names and what they mean, a line each."""
    width = max(map(len, known))
    return "\n".join(f"{name:<{width}}  {meaning}" for name, meaning in known.items())


def console() -> "Console":
    """Progress and notes go to stderr; stdout is for results."""
    from rich.console import Console

    return Console(stderr=True, highlight=False)


def say(line: str) -> None:
    """Prints a note to stderr, as it stands."""
    console().print(line, soft_wrap=True, markup=False)


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
    on = console()
    if not on.is_terminal:
        yield ProgressDisplay(None)
        return
    from rich import progress as rich

    columns = (rich.TextColumn("{task.description}"), rich.BarColumn(), rich.TaskProgressColumn())
    with rich.Progress(*columns, rich.TimeElapsedColumn(), console=on, transient=True) as bar:
        yield ProgressDisplay(bar)


def run(main: Callable[[Sequence[str]], object], argv: Sequence[str] | None = None) -> int:
    """Runs `main(argv)` and returns the exit code.

    0: done. 2: the input or the call is wrong (one line on stderr, no traceback).
    130: stopped with Ctrl-C. 141: nobody reads on (`| head`), so that it stopped, as a shell
    counts it. Any other exception is a bug: traceback, exit code 1.
    """
    try:
        main(sys.argv[1:] if argv is None else argv)
        return 0
    except InputError as error:
        print(f"error: {' '.join(str(error).split())}", file=sys.stderr)
        return 2
    except KeyboardInterrupt as stopped:
        print(str(stopped) or "stopped; what was finished is saved", file=sys.stderr)
        return STOPPED
    except BrokenPipeError:
        # What is still in the buffer has nowhere to go, either: no second complaint at the exit.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 141
