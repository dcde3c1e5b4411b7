"""Errors a user can mend: wrong input or a wrong call."""

from collections.abc import Iterator
from contextlib import contextmanager


class InputError(ValueError):
    """A wrong input or call, in one line; commands print it and exit with 2.

    The message names the file, the key, the value found and what would be right:
    ``clip.yaml: ramp_angle_deg: 95 is outside (0, 90) degrees``.
    """


@contextmanager
def named(what: object) -> Iterator[None]:
    """Begins what an `InputError` inside says with the name of the file that it is about."""
    try:
        yield
    except InputError as error:
        raise InputError(f"{what}: {error}") from None
