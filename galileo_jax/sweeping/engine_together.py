"""Many tasks at once in this process, their calls of compiled programs made together.

What an accelerator is good for: it computes the step of one fit in the time of a hundred. On a CPU
the processes of `EngineLocal` are faster.
"""

import contextvars
import queue
import threading
from collections.abc import Iterable, Iterator

from galileo_jax.runtime.call_merging import Together
from galileo_jax.sweeping.task import Outcome, Task, attempt


class EngineTogether:
    """Carries out tasks in threads of this process, whose calls `group` makes together."""

    def __init__(self, num_together: int):
        self.num_together = num_together
        self.group = Together()

    def outcomes(self, tasks: Iterable[Task]) -> Iterator[Outcome]:
        """See `Engine`."""
        waiting, lock = iter(tasks), threading.Lock()
        done: queue.Queue[Outcome | BaseException | None] = queue.Queue()

        def work() -> None:
            try:
                with self.group.member():
                    while True:
                        with lock:
                            task = next(waiting, None)
                        if task is None:
                            return
                        done.put(attempt(task))
            except BaseException as error:
                done.put(error)
            finally:
                done.put(None)

        self.group.expect(self.num_together)
        for _ in range(self.num_together):
            # Cancelling, and who is told of progress, belong to the context of the caller.
            run = contextvars.copy_context().run
            threading.Thread(target=run, args=(work,), daemon=True).start()
        left = self.num_together
        while left:
            found = done.get()
            if found is None:
                left -= 1
            elif isinstance(found, BaseException):
                self.close()
                raise found
            else:
                yield found

    def close(self) -> None:
        """Ends the tasks at their next call of a program."""
        self.group.close()
