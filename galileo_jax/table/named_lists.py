"""Named lists and arrays, those of JSON and of MATLAB, to rows of cells as a table has them.

{"fps": 30, "track": {"x": [0, 1], "y": [5, 4]}}      # fps,30
                         or                       ->  x,y
{"fps": 30, "track": [{"x": 0, "y": 5}, ...]}         0,5
"""

import io
import json
import warnings
from collections.abc import Iterator
from itertools import zip_longest
from typing import Any

import numpy as np

from galileo_jax.runtime.errors import InputError
from galileo_jax.table.numbers import Rows
from galileo_jax.table.titles import title_of

MATLAB, MATLAB_7_3 = b"MATLAB 5.0", b"MATLAB 7.3"
MOST_NUMBERS = 4_000_000
AXES = ("x", "y", "z")
Path = tuple[str, ...]
"""The names that lead to a list, the outermost first."""


def named_lists(content: bytes) -> Rows | None:
    """The rows of a JSON or MATLAB file; None: it is neither.

    Raises:
      InputError: it is one, and holds no lists of numbers, or too many numbers.
    """
    if content.startswith(MATLAB_7_3):
        raise InputError("a MATLAB 7.3 file; save it with '-v7', or as a table")
    if content.startswith(MATLAB):
        tree = _matlab(content)
    elif content.lstrip(b"\xef\xbb\xbf \t\r\n")[:1] in (b"{", b"["):
        try:
            # Numbers stay as they are printed: their digits tell how well they are known.
            tree = json.loads(content, parse_float=str, parse_int=str)
        except (ValueError, RecursionError):
            return None
    else:
        return None
    columns: list[tuple[Path, list[str]]] = []
    settings: list[list[str]] = []
    try:
        for path, value in _leaves(tree):
            if isinstance(value, list):
                columns.append((path, [_written(one) for one in value]))
            else:
                settings.append(["# " + "".join(path[-1:]), _written(value)])
    except RecursionError:
        raise InputError("lists in lists in lists; lists of times and places expected") from None
    lengths = [len(cells) for _, cells in columns]
    if max(lengths, default=0) < 2:
        raise InputError("no lists of numbers in it; lists of times and places expected")
    usual = max(sorted(set(lengths)), key=lengths.count)
    used = [(path, cells) for path, cells in columns if len(cells) == usual]
    titles = _titles([path for path, _ in used])
    body = [list(row) for row in zip(*(cells for _, cells in used), strict=True)]
    return list(enumerate([*settings, *([titles] if any(titles) else []), *body], 1))


def _titles(paths: list[Path]) -> list[str]:
    """The last name of each path; more of it where several lists end alike."""
    last = [path[-1] if path else "" for path in paths]
    return [
        " ".join(path) if name and last.count(name) > 1 else name
        for path, name in zip(paths, last, strict=True)
    ]


def _matlab(content: bytes) -> Any:
    """The variables of a file; a structure as a dictionary."""
    from scipy.io import loadmat, whosmat  # a third of a second, which other tables do not need

    try:
        sizes = [int(np.prod(shape)) for _, shape, _ in whosmat(io.BytesIO(content))]
        _check_size(sum(sizes))
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # of variables that no array can hold
            found = loadmat(io.BytesIO(content), squeeze_me=True, struct_as_record=False)
    except InputError:
        raise
    except Exception as error:  # whatever the bytes make of it
        reason = " ".join(str(error).split())[:100]
        raise InputError(f"not a whole MATLAB file ({reason})") from None
    return {name: _plain(one) for name, one in found.items() if not name.startswith("__")}


def _plain(value: Any) -> Any:
    """Structures as dictionaries, arrays as lists of rows."""
    if hasattr(value, "_fieldnames"):  # a structure
        return {name: _plain(one) for name, one in vars(value).items() if name[0] != "_"}
    if isinstance(value, np.ndarray):
        return [_plain(one) for one in value] if value.dtype == object else value.tolist()
    return value


def _leaves(tree: Any, path: Path = (), is_timed: bool = False) -> Iterator[tuple[Path, Any]]:
    """Each list of numbers or words, and each single value, with the names that lead to it.

    The columns of an array beside a list of times are x, y and z; of others no names are known.
    """
    if isinstance(tree, dict):
        is_timed |= any(title_of(str(key)).role in ("time", "frame") for key in tree)
        for key, value in tree.items():
            yield from _leaves(value, (*path, str(key)), is_timed)
    elif not isinstance(tree, list) or not any(isinstance(one, dict | list) for one in tree):
        yield path, tree
    elif all(isinstance(one, dict) for one in tree):
        keys = dict.fromkeys(key for record in tree for key in record)
        _check_size(len(keys) * len(tree))
        records = {key: [record.get(key) for record in tree] for key in keys}
        yield from _leaves(records, path, is_timed)
    elif all(isinstance(one, list | None) for one in tree):
        _check_size(len(tree) * max(len(row or ()) for row in tree))
        columns = [list(column) for column in zip_longest(*(row or () for row in tree))]
        if len(columns) > len(tree) and all(tree):
            columns = tree
        is_place = is_timed and len(columns) <= len(AXES)
        for n, column in enumerate(columns):
            yield from _leaves(column, (*path, AXES[n]) if is_place else (), is_timed)


def _check_size(count: int) -> None:
    if count > MOST_NUMBERS:
        raise InputError(f"{count} numbers; at most {MOST_NUMBERS} expected; keep time and place")


def _written(value: Any) -> str:
    return "" if value is None or isinstance(value, list | dict) else str(value)
