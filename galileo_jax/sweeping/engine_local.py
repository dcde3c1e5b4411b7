"""The local engine: processes on this machine, each with a task at a time.

A worker that dies (memory, a crash in native code) takes nothing with it: its task is known,
is given to a new worker, and fails only when that has died as well. Workers end with the
process that started them, however that ends.

loky in its place breaks two of these promises (docs/history/speed.md).
"""

import multiprocessing
import os
import signal
import sys
from collections.abc import Iterable, Iterator, Mapping
from contextlib import suppress
from multiprocessing.connection import Connection, wait
from typing import Any

from galileo_jax.runtime.child_process import end_with_parent
from galileo_jax.sweeping.resources import Resources, environment_of
from galileo_jax.sweeping.task import MAX_TRIES, Outcome, Task, attempt, died


class EngineHere:
    """Carries out tasks in this process, one by one."""

    def outcomes(self, tasks: Iterable[Task]) -> Iterator[Outcome]:
        """See `Engine`."""
        return map(attempt, tasks)

    def close(self) -> None:
        """Nothing to end."""


class EngineLocal:
    """Carries out tasks in processes of this machine."""

    def __init__(self, num_workers: int, each: Resources = Resources()):  # noqa: B008
        self.num_workers, self.each = num_workers, each
        self._workers: dict[int, _Worker] = {}

    def outcomes(self, tasks: Iterable[Task]) -> Iterator[Outcome]:
        """See `Engine`.

        The first worker carries out the first task alone: what it compiles the others read
        from JAX's cache.
        """
        waiting = iter(tasks)
        again: list[tuple[Task, int]] = []  # tasks whose worker died, and how often
        is_warm = False
        while True:
            for number in range(self.num_workers if is_warm else 1):
                worker = self._workers.get(number)
                if worker is not None and worker.task is not None:
                    continue
                task, tries = again.pop() if again else (next(waiting, None), 0)
                if task is None:
                    break
                self._worker(number).give(task, tries + 1)
            busy = {w.connection: w for w in self._workers.values() if w.task is not None}
            if not busy:
                return
            for connection in wait(list(busy)):
                worker = busy[connection]  # pyright: ignore[reportArgumentType]
                outcome = worker.take()
                if outcome is None:
                    assert worker.task is not None
                    del self._workers[worker.number]
                    if worker.tries < MAX_TRIES:
                        again.append((worker.task, worker.tries))
                        continue
                    outcome = died(worker.task, f"its worker died ({worker.ending()})")
                is_warm = True
                yield outcome

    def close(self) -> None:
        """Ends the workers."""
        for worker in self._workers.values():
            worker.process.kill()
            worker.process.join()
            worker.connection.close()
        self._workers.clear()

    def _worker(self, number: int) -> "_Worker":
        if number not in self._workers:
            self._workers[number] = _Worker(number, environment_of(number, self.each))
        return self._workers[number]


class _Worker:
    """A process, the line to it, and the task it has."""

    def __init__(self, number: int, environment: Mapping[str, str]):
        context = multiprocessing.get_context("spawn")  # JAX's threads do not survive a fork
        self.number = number
        self.task: Task | None = None
        self.tries = 0
        self.connection, far = context.Pipe()
        self.process = context.Process(target=_serve, args=(far, dict(environment)), daemon=True)
        self.process.start()
        far.close()

    def give(self, task: Task, tries: int) -> None:
        """Gives it a task that so many workers have begun, itself among them."""
        self.task, self.tries = task, tries
        with suppress(BrokenPipeError, ConnectionResetError):  # `take` will say that it died idle
            self.connection.send(task)

    def take(self) -> Outcome | None:
        """Its outcome; None where it died."""
        try:
            outcome: Outcome = self.connection.recv()
        except (EOFError, ConnectionResetError):
            self.process.join()
            return None
        self.task = None
        return outcome

    def ending(self) -> str:
        """How it ended, in words."""
        code = self.process.exitcode or 0
        return f"signal {signal.Signals(-code).name}" if code < 0 else f"exit code {code}"


def _serve(connection: Connection, environment: dict[str, str]) -> None:
    """The worker's process: tasks in, outcomes out, until the line is cut."""
    os.environ.update(environment)
    sys.stderr = open(os.devnull, "w")  # noqa: SIM115  # progress bars of many at once
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C is for the parent, which ends workers
    end_with_parent()
    while True:
        try:
            task: Any = connection.recv()
        except EOFError:
            return
        connection.send(attempt(task))
