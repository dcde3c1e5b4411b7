"""Long work in a process of its own: one job at a time, cancelled between two batches.

The process is spawned (JAX does not survive a fork), is niced so that the page stays quick, and
ends with the server, however that ends: it waits for its parent beside the work.
"""

import contextlib
import itertools
import math
import multiprocessing
import os
import queue
import threading
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from multiprocessing.connection import Connection
from typing import Any, Literal

from galileo_jax.runtime.child_process import end_with_parent

NICENESS = 5
PATIENCE_S = 20.0  # for work that was cancelled to stop by itself, before its process is ended

LEAST_SPENT_S, LEAST_SHARE = 3.0, 0.05  # before it is said how long a job will take

Kind = Literal["progress", "partial", "done", "error", "cancelled"]


@dataclass(frozen=True)
class Message:
    """What a job says."""

    job: int  # its number
    task: str  # what it does
    # `progress` with (stage, share), `partial` or `done` with a mapping, `error` with a line,
    # `cancelled`.
    kind: Kind
    content: Any = None  # see `kind`


@dataclass(frozen=True)
class Job:
    """The job that runs, as the page shows it."""

    task: str
    stage: str = "starting"
    share: float = 0.0
    is_cancelled: bool = False
    begun: float = field(default_factory=time.monotonic)

    def time_left(self, now: float) -> str:
        """How long it will still take if it goes on as until now; "" while that is unknown."""
        spent = now - self.begun
        if self.is_cancelled or spent < LEAST_SPENT_S or not LEAST_SHARE < self.share < 1:
            return ""
        seconds = spent * (1 - self.share) / self.share
        return f"about {10 * math.ceil(seconds / 10)} s left"


class Worker:
    """The process, started when it is first needed and again if it ends.

    `on_message` is called in a thread of this process.
    """

    def __init__(self, folder: str, on_message: Callable[[Message], None]):
        self._folder, self._on_message = folder, on_message
        self._numbers = itertools.count(1)
        self._lock = threading.Lock()
        self._process: Any = None
        self._pipe: Connection | None = None
        self._is_cancelled = False
        self._current: Message | None = None  # the job that runs

    @property
    def pid(self) -> int | None:
        """Of the process, while it runs."""
        return self._process.pid if self._process is not None else None

    def start(self, task: str, **given: Any) -> int:
        """Starts a job; returns its number.

        Raises:
          RuntimeError: another is running.
        """
        with self._lock:
            if self._current is not None:
                raise RuntimeError(f"{self._current.task} is running")
            number, self._is_cancelled = self._send("job", task, given), False
            self._current = Message(number, task, "progress")
            return number

    def ask(self, task: str, **given: Any) -> int:
        """Sends a quick question, answered beside the job."""
        with self._lock:
            return self._send("ask", task, given)

    def cancel(self) -> None:
        """Asks the job to stop; its process is ended if it does not."""
        with self._lock:
            if self._current is None:
                return
            self._is_cancelled = True
            if self._pipe is not None:
                with contextlib.suppress(OSError):
                    self._pipe.send(("cancel",))
            timer = threading.Timer(PATIENCE_S, self._end_if_busy, [self._current.job])
        timer.daemon = True
        timer.start()

    def close(self) -> None:
        """Ends the process."""
        with self._lock:
            process, self._process = self._process, None
        if process is not None:
            process.kill()
            process.join(5)

    def _send(self, kind: str, task: str, given: Mapping[str, Any]) -> int:
        if self._pipe is None or self._process is None or not self._process.is_alive():
            context = multiprocessing.get_context("spawn")
            self._pipe, theirs = context.Pipe()
            self._process = context.Process(target=serve, args=(theirs, self._folder), daemon=True)
            self._process.start()
            theirs.close()
            threading.Thread(target=self._listen, args=(self._pipe,), daemon=True).start()
        number = next(self._numbers)
        self._pipe.send((kind, number, task, given))
        return number

    def _listen(self, pipe: Connection) -> None:
        with contextlib.suppress(EOFError, OSError):
            while True:
                self._hand_on(pipe.recv())
        with self._lock:
            if pipe is not self._pipe:
                return
            lost, self._pipe, is_cancelled = self._current, None, self._is_cancelled
        if lost is not None:
            kind: Kind = "cancelled" if is_cancelled else "error"
            text = "the process that computed it has ended; try again"
            self._hand_on(Message(lost.job, lost.task, kind, text))

    def _hand_on(self, message: Message) -> None:
        with self._lock:
            is_over = message.kind not in ("progress", "partial")
            if is_over and self._current is not None and self._current.job == message.job:
                self._current = None
        self._on_message(message)

    def _end_if_busy(self, job: int) -> None:
        with self._lock:
            is_busy = self._current is not None and self._current.job == job
            process = self._process
        if is_busy and process is not None:
            process.kill()


def serve(pipe: Connection, folder: str) -> None:
    """What the process does: jobs in its main thread, questions in another."""
    end_with_parent()
    with contextlib.suppress(OSError, AttributeError):
        os.nice(NICENESS)
    os.chdir(folder)
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    lines: dict[str, queue.SimpleQueue[Any]] = {
        kind: queue.SimpleQueue() for kind in ("job", "ask")
    }
    lock, cancel = threading.Lock(), threading.Event()

    def send(message: Message) -> None:
        with lock, contextlib.suppress(OSError):
            pipe.send(message)

    def receive() -> None:
        while True:
            try:
                kind, *rest = pipe.recv()
            except (EOFError, OSError):
                os._exit(0)
            if kind == "cancel":
                cancel.set()
                continue
            if kind == "job":
                cancel.clear()  # the one before it is over
            lines[kind].put(rest)

    def answer(kind: str) -> None:
        while True:
            number, task, given = lines[kind].get()
            _run(number, task, given, send, cancel if kind == "job" else None)

    threading.Thread(target=receive, daemon=True).start()
    threading.Thread(target=answer, args=("ask",), daemon=True).start()
    answer("job")


def _run(
    number: int,
    task: str,
    given: Mapping[str, Any],
    send: Callable[[Message], None],
    cancel: Any,
) -> None:
    import galileo_jax as gx
    from galileo_jax.runtime.errors import InputError
    from galileo_jax.runtime.progress import Cancelled, scope

    def on_progress(stage: str, share: float, partial: Any) -> None:
        send(Message(number, task, "progress", (stage, share)))
        if isinstance(partial, dict | gx.Explanation):
            send(Message(number, task, "partial", work.shown(partial)))

    try:
        from galileo_jax.studio import work

        with scope(on_progress, cancel):
            content = getattr(work, task)(**given)
        send(Message(number, task, "done", content))
    except Cancelled:
        send(Message(number, task, "cancelled"))
    except InputError as error:
        send(Message(number, task, "error", " ".join(str(error).split())))
    except Exception as error:  # a bug must not end the process; the page shows it
        import traceback

        traceback.print_exc()
        send(Message(number, task, "error", f"{type(error).__name__}: {error}"))
