"""A sweep that Ctrl-C stops."""

from collections.abc import Callable
from typing import Any


def stopping(compute: Callable[..., Any], count: int) -> Callable[..., Any]:
    """`compute`, which is stopped at every call after so many."""
    left = count

    def stopped(*arguments: Any) -> Any:
        nonlocal left
        if left == 0:
            raise KeyboardInterrupt
        left -= 1
        return compute(*arguments)

    return stopped
