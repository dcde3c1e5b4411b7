"""Progress of long work, and how it is cancelled between two batches.

The public functions open a scope; whatever computes below them reports to it:

    with scope(on_progress, cancel):
        report("fitting", 0.2)          # calls on_progress("fitting", 0.2, None)
        with part(0.3, 0.9):
            report("candidates", 0.5)   # calls on_progress("candidates", 0.6, None)
        check_cancelled()               # raises Cancelled where somebody asked for it

A scope belongs to the thread (and asyncio task) that opened it, so that two calls in two threads
do not see each other's. Without a scope all of these do nothing.
"""

from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager, nullcontext
from contextvars import ContextVar
from dataclasses import dataclass, replace
from typing import Any, Protocol, runtime_checkable

OnProgress = Callable[[str, float, Any], object]
"""Called with the stage, the share of the whole call that is done (0 to 1), and what there is of
the result (or None)."""


class Cancelled(Exception):  # noqa: N818 - an outcome that the caller asked for, not an error
    """Work was stopped between two batches because its caller asked for it."""


@runtime_checkable
class CancelFlag(Protocol):
    """Anything with `is_set`, such as `threading.Event`."""

    def is_set(self) -> bool:
        """Whether the work is to stop."""
        ...


@dataclass(frozen=True)
class _Scope:
    on_progress: OnProgress | None
    cancel: CancelFlag | None
    start: float = 0.0
    end: float = 1.0


_scope: ContextVar[_Scope | None] = ContextVar("galileo_jax_progress", default=None)


def scope(
    on_progress: OnProgress | None = None, cancel: CancelFlag | None = None
) -> AbstractContextManager[None]:
    """Sends what is reported inside to `on_progress`; a call inside another's scope joins it."""
    is_joined = on_progress is None and cancel is None
    return nullcontext() if is_joined else _inside(_Scope(on_progress, cancel))


def part(start: float, end: float) -> AbstractContextManager[None]:
    """What is reported inside, from 0 to 1, is this part of the work outside."""
    outer = _scope.get()
    if outer is None:
        return nullcontext()
    width = outer.end - outer.start
    own = replace(outer, start=outer.start + start * width, end=outer.start + end * width)
    return _inside(own)


@contextmanager
def _inside(scope: _Scope) -> Iterator[None]:
    token = _scope.set(scope)
    try:
        yield
    finally:
        _scope.reset(token)


def report(stage: str, share: float, partial: Any = None) -> None:
    """Reports a stage, the share of the work that is done, and a partial result.

    Raises `Cancelled` where the caller asked for it.
    """
    check_cancelled()
    now = _scope.get()
    if now is not None and now.on_progress is not None:
        share = min(max(share, 0.0), 1.0)
        now.on_progress(stage, now.start + share * (now.end - now.start), partial)


def check_cancelled() -> None:
    """Raises `Cancelled` where the caller asked for it; called between two batches."""
    now = _scope.get()
    if now is not None and now.cancel is not None and now.cancel.is_set():
        raise Cancelled("cancelled")
