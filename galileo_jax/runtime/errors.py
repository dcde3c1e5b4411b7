"""Errors a user can mend: wrong input or a wrong call."""

from collections.abc import Iterator
from contextlib import contextmanager


class InputError(ValueError):
    """A wrong input or call, in one line; commands print it and exit with 2.

    The message names the file, the key, the value found and what would be right:
    ``clip.yaml: ramp_angle_deg: 95 is outside (0, 90) degrees``.
    """


@contextmanager
def one_line_of(what: object) -> Iterator[None]:
    """Turns what goes wrong with files inside into one line that begins with `what`."""
    try:
        yield
    except OSError as error:
        raise InputError(f"{what}: {error.strerror or error}") from error


@contextmanager
def named(what: object) -> Iterator[None]:
    """Begins what an `InputError` inside says with the name of the file that it is about."""
    try:
        yield
    except InputError as error:
        raise InputError(f"{what}: {error}") from None
