"""Calls of compiled programs from several threads, made in one.

Fits of different clips call the same programs with other numbers. An accelerator computes a hundred
such calls in the time of one; so each fit runs in a thread of its own, and where all of them wait
for a program, the calls of the same one, of the same shapes, become one call with one axis more
(`jax.vmap`). No fit knows of the others, and each gives what it would give alone, but for rounding.

    group = Together()
    with group.member(): ...     # in each thread; what it calls inside is made together

A program has `key_of(args)`, what calls have in common that can be made together, and
`of_many(calls)`, the results of several with the same key (`trace_cache.TraceCached`).

On a CPU nothing is gained: a core computes one call after the other, whoever asks.
"""

import threading
from collections.abc import Iterator, Sequence
from concurrent.futures import Future
from contextlib import contextmanager
from typing import Any, NamedTuple

import jax

from galileo_jax.runtime.progress import Cancelled


class _Call(NamedTuple):
    program: Any
    args: tuple[Any, ...]
    is_64_bit: bool
    result: Future[Any]


_own = threading.local()


def current() -> "Together | None":
    """The group that the calling thread is a member of."""
    return getattr(_own, "group", None)


class Together:
    """Threads whose calls are made together.

    Attributes:
      num_calls, num_made: how many calls members asked for, and how many were made.
    """

    def __init__(self) -> None:
        self.num_calls = self.num_made = 0
        self._lock = threading.Lock()
        self._num_members = 0
        self._waiting: list[_Call] = []
        self._is_closed = False

    def expect(self, count: int = 1) -> None:
        """Members to come, which the others wait for; each then enters `member` once."""
        with self._lock:
            self._num_members += count

    @contextmanager
    def member(self) -> Iterator[None]:
        """The calling thread's calls are made with those of the others, inside."""
        _own.group = self
        try:
            yield
        finally:
            _own.group = None
            with self._lock:
                self._num_members -= 1
                self._make_if_all_wait()

    def call(self, program: Any, args: tuple[Any, ...]) -> Any:
        """The program's result, once all members wait for theirs; `Cancelled` once it is closed."""
        own = _Call(program, args, jax.config.read("jax_enable_x64"), Future())
        with self._lock:
            if self._is_closed:
                raise Cancelled("cancelled")
            self._waiting.append(own)
            self._make_if_all_wait()
        return own.result.result()

    def close(self) -> None:
        """No call is made any more."""
        with self._lock:
            self._is_closed = True
            for one in self._waiting:
                one.result.set_exception(Cancelled("cancelled"))
            self._waiting = []

    def _make_if_all_wait(self) -> None:
        """Makes what most members wait for: in loops they soon come to what the others wait for.

        The lock is held meanwhile, for all of them wait.
        """
        if len(self._waiting) < self._num_members or not self._waiting:
            return
        groups: dict[Any, list[_Call]] = {}
        for one in self._waiting:
            key = (id(one.program), one.is_64_bit, one.program.key_of(one.args))
            groups.setdefault(key, []).append(one)
        self._make(max(groups.values(), key=len))
        self._waiting = [one for one in self._waiting if not one.result.done()]

    def _make(self, calls: Sequence[_Call]) -> None:
        self.num_calls += len(calls)
        self.num_made += 1
        first = calls[0]
        try:
            with jax.enable_x64(first.is_64_bit):
                results = first.program.of_many([one.args for one in calls])
            for one, result in zip(calls, results, strict=True):
                one.result.set_result(result)
        except Exception as error:
            for one in calls:
                one.result.set_exception(error)
