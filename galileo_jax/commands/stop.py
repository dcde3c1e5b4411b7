"""Ctrl-C: it stops what runs soon and quietly, wherever it finds the program."""

import os
import signal
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any, NoReturn

from galileo_jax.runtime.atomic_write import remove_unfinished

STOPPED = 130  # the exit code of what Ctrl-C ends, as shells count it
GRACE_S = 3.0  # to end by itself: more than a file takes to be written, and not yet long to wait


@contextmanager
def stoppable(last_words: Callable[[], str]) -> Iterator[threading.Event]:
    """A flag that Ctrl-C sets besides raising `KeyboardInterrupt`, for as long as this is open.

    Where the interrupt falls into a callback of a library it is lost; the flag is what the work
    looks at between two batches (`runtime.progress`). A library that computes for long hears
    neither: after `GRACE_S` the program ends without it, with `last_words`.
    """
    flag, is_over = threading.Event(), threading.Event()
    if threading.current_thread() is not threading.main_thread():
        yield flag  # only the main thread hears signals
        return

    def heard(*_: Any) -> NoReturn:
        flag.set()
        raise KeyboardInterrupt

    def watch() -> None:
        while (told := os.read(ear, 1)) and told[0] != signal.SIGINT:
            if is_over.is_set():
                return
        flag.set()
        if not is_over.wait(GRACE_S):
            print(last_words(), file=sys.stderr)
            remove_unfinished()
            leave(STOPPED)

    ear, mouth = os.pipe()
    os.set_blocking(mouth, False)  # as `set_wakeup_fd` wants it
    before = signal.signal(signal.SIGINT, heard)
    mouth_before = signal.set_wakeup_fd(mouth, warn_on_full_buffer=False)
    watcher = threading.Thread(target=watch, daemon=True)
    watcher.start()
    try:
        yield flag
    finally:
        is_over.set()
        signal.set_wakeup_fd(mouth_before)
        signal.signal(signal.SIGINT, before)
        os.write(mouth, b"\0")
        watcher.join()
        os.close(ear)
        os.close(mouth)


def end(code: int) -> NoReturn:
    """Ends the program; where it was stopped or refused, without waiting for what still compiles.

    By then everything that was being written is whole or gone (`runtime.atomic_write`), and the
    threads that are left make programs for the cache. XLA aborts the process if Python ends one of
    them.
    """
    # What ends by itself has nothing left to be saved: a Ctrl-C now needs no traceback.
    signal.signal(signal.SIGINT, signal.SIG_DFL)
    if code == STOPPED or (code and threading.active_count() > 1):
        leave(code)
    sys.exit(code)


def leave(code: int) -> NoReturn:
    """Ends the program at once."""
    sys.stdout.flush()
    sys.stderr.flush()
    os._exit(code)
