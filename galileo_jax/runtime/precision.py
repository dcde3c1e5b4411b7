"""64-bit arithmetic for the duration of a call, whatever the caller has set for JAX."""

import functools
from collections.abc import Callable
from typing import ParamSpec, TypeVar

Given = ParamSpec("Given")
Result = TypeVar("Result")


def in_float64(function: Callable[Given, Result]) -> Callable[Given, Result]:
    """Runs a function with JAX in 64 bit, in this thread only; JAX is imported when it is called.

    The first such call of a process also switches on the compilation cache (`jax_setup`).
    """

    @functools.wraps(function)
    def wrapped(*args: Given.args, **kwargs: Given.kwargs) -> Result:
        import jax

        from galileo_jax.runtime.jax_setup import set_up

        set_up()
        with jax.enable_x64(True):
            return function(*args, **kwargs)

    return wrapped
