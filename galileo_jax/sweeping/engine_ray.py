"""The Ray engine: the same tasks on a Ray cluster, this machine alone or many.

Tasks carry all they need and bring all they found: workers share no files with the driver, and
only the driver writes. A task whose worker or node is lost is carried out again elsewhere by
Ray; its outcome comes once, because the driver waits for it by name.
"""

import logging
import os
import socket
from collections.abc import Iterable, Iterator
from typing import Any

from galileo_jax.runtime.errors import InputError
from galileo_jax.sweeping.resources import Resources
from galileo_jax.sweeping.task import MAX_TRIES, Outcome, Task, attempt, died

AHEAD = 2  # tasks given to the cluster for each of its slots, so that none waits for the driver
ANSWER_S = 10.0  # for a cluster to answer
LOOK_S = 5.0  # between looks at how large the cluster is


class EngineRay:
    """Carries out tasks on a Ray cluster."""

    def __init__(self, address: str | None, each: Resources = Resources()):  # noqa: B008
        """Joins the cluster at `address`; without one, starts a cluster on this machine.

        Raises:
          InputError: Ray is not installed, or no cluster answers.
        """
        try:
            import ray  # pyright: ignore[reportMissingImports]
        except ImportError:
            raise InputError(
                "--engine ray: Ray is not installed; pip install 'galileo-jax[distributed]'"
            ) from None
        self._ray, self.each = ray, each
        try:
            _knock(address)
            ray.init(address=address or "local", log_to_driver=False, logging_level=logging.ERROR)
        except (OSError, ValueError, RuntimeError) as error:
            raise InputError(f"--address: no Ray cluster at {address} ({error})") from error
        self._attempt = ray.remote(attempt_as_worker).options(
            num_cpus=each.cpus, num_gpus=each.gpus, max_retries=MAX_TRIES - 1
        )

    def outcomes(self, tasks: Iterable[Task]) -> Iterator[Outcome]:
        """See `Engine`."""
        waiting = iter(tasks)
        running: dict[Any, Task] = {}
        while True:
            room = AHEAD * self._num_slots()
            while len(running) < room and (task := next(waiting, None)) is not None:
                running[self._attempt.remote(task, self.each)] = task
            if not running:
                return
            done, _ = self._ray.wait(list(running), timeout=LOOK_S)
            for reference in done:
                task = running.pop(reference)
                try:
                    yield self._ray.get(reference)
                except self._ray.exceptions.RayError as error:
                    yield died(task, f"its worker died ({type(error).__name__})")

    def close(self) -> None:
        """Leaves the cluster, whose workers drop what they are doing."""
        self._ray.shutdown()

    def _num_slots(self) -> int:
        there = self._ray.cluster_resources()
        slots = there.get("CPU", 0) // self.each.cpus
        if self.each.gpus:
            slots = min(slots, there.get("GPU", 0) // self.each.gpus)
        return max(int(slots), 1)


def _knock(address: str | None) -> None:
    """Raises `OSError` if nothing listens at HOST:PORT: Ray would try for minutes."""
    host, _, port = (address or "").removeprefix("ray://").rpartition(":")
    if port.isdecimal():
        socket.create_connection((host, int(port)), timeout=ANSWER_S).close()


def attempt_as_worker(task: Task, each: Resources) -> Outcome:
    """`attempt` in a process that Ray started: sees to its environment first."""
    os.environ.update(each.environment())
    return attempt(task)
