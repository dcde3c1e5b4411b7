"""What every command shares: one-line errors, exit codes, progress."""

import argparse
import os
import sys
from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING, Any, NoReturn

from galileo_jax.commands.stop import STOPPED
from galileo_jax.runtime.errors import InputError

if TYPE_CHECKING:
    from rich.console import Console


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
