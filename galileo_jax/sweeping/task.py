"""A task, what came of it, and what every engine of a sweep does with tasks."""

import traceback
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from typing import Any, Literal, Protocol

from galileo_jax.runtime.errors import InputError
from galileo_jax.runtime.progress import Cancelled

MAX_TRIES = 3  # of a task whose worker died: the third death is no accident


@dataclass(frozen=True)
class Task:
    """A call that can be made anywhere: function and arguments can be pickled."""

    key: str  # of the task, unique among those given to an engine together
    function: Callable[..., Any]
    arguments: tuple[Any, ...]


@dataclass(frozen=True)
class Failure:
    """Why there is no result."""

    # "input": the clip or the call is wrong; "bug": anything else that was raised; "died": the
    # worker did, each time
    kind: Literal["input", "bug", "died"]
    line: str  # the reason in one line
    details: str = ""  # the traceback of a bug


@dataclass(frozen=True)
class Outcome:
    """What came of a task: a value, or a failure."""

    key: str
    value: Any = None
    failure: Failure | None = None


class Engine(Protocol):
    """Something that carries out tasks."""

    def outcomes(self, tasks: Iterable[Task]) -> Iterator[Outcome]:
        """One outcome for every task, as they come; takes tasks only as workers become free."""
        ...

    def close(self) -> None:
        """Ends the workers, whatever they are doing."""
        ...


def attempt(task: Task) -> Outcome:
    """Carries out a task, here and now; whatever it raises becomes its failure.

    Raises:
      Cancelled: the caller asked for it, which is nobody's failure.
    """
    try:
        return Outcome(task.key, task.function(*task.arguments))
    except Cancelled:
        raise
    except Exception as error:
        line = " ".join(str(error).split())
        if isinstance(error, InputError):
            return Outcome(task.key, failure=Failure("input", line))
        line, details = f"{type(error).__name__}: {line}", traceback.format_exc()
        return Outcome(task.key, failure=Failure("bug", line, details))


def died(task: Task, cause: str) -> Outcome:
    """The outcome of a task that no worker survived."""
    return Outcome(task.key, failure=Failure("died", f"{cause}, {MAX_TRIES} times"))
