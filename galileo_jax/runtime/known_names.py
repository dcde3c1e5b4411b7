"""Names of options; refusing a name that there is not, with the nearest one that there is."""

import difflib
from collections.abc import Collection, Iterable

from galileo_jax.runtime.errors import InputError


def check_known(option: str, noun: str, name: object, known: Collection[str]) -> None:
    """Refuses a name that is none of `known`, in one line with the nearest and all of them."""
    if name not in known:
        hint = did_you_mean(str(name), known) or ";"
        raise InputError(f"{option}: unknown {noun} {name!r}{hint} known: {', '.join(known)}")


def option_of(keyword: str) -> str:
    """The option of a command for an argument of a function: --max-steps of max_steps."""
    return f"--{keyword.replace('_', '-')}"


def did_you_mean(name: str, known: Iterable[str]) -> str:
    """`; did you mean X?` where a known name is near, else nothing."""
    near = difflib.get_close_matches(name, list(known), n=1)
    return f"; did you mean {near[0]}?" if near else ""
