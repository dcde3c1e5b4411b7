"""Text tables as spreadsheets and laboratory programs write them: rows of cells, and numbers.

Whatever a spreadsheet makes of a table when it saves it again is read here, and nowhere else:
commas, semicolons or tabs between the cells (also named by a first line `sep=;`), decimal commas,
a byte-order mark, any line ends, quotes (also round whole lines), empty rows and columns.
"""

import csv
import io
import math
import re
from pathlib import Path

import numpy as np

from galileo_jax.runtime.errors import InputError

EMPTY = "empty; a row of titles and numbers expected"
SEPARATORS = ("\t", ";", ",")
SEPARATOR_LINE = re.compile(r"sep=([\t;,])\s*", re.IGNORECASE)  # Excel's own first line
COMMA_IN_NUMBER = re.compile(r"[-+]?\d+,\d*(e[-+]?\d+)?", re.IGNORECASE)
POINT_IN_NUMBER = re.compile(r"[-+]?\d*\.\d*(e[-+]?\d+)?", re.IGNORECASE)

Rows = list[tuple[int, list[str]]]
"""Each row's line number in the file, and its cells."""


def decoded(content: bytes) -> str:
    """Text in UTF-8 or UTF-16, or in Windows' old western encoding, which reads everything."""
    if content.startswith((b"\xff\xfe", b"\xfe\xff")):
        return content.decode("utf-16", errors="replace")
    try:
        return content.decode("utf-8-sig")
    except UnicodeDecodeError:
        return content.decode("cp1252", errors="replace")


def separator(text: str) -> str:
    """What separates the cells: the first of tab, semicolon and comma in the first lines."""
    first_lines = "\n".join(text.splitlines()[:3])
    return next((mark for mark in SEPARATORS if mark in first_lines), ",")


def first_cells(head: bytes, num_lines: int = 3) -> list[list[str]]:
    """The cells of the first lines that are not blank, lower case: by these a file is known."""
    if b"\0" in head and not head.startswith((b"\xff\xfe", b"\xfe\xff")):
        return []
    mark, text = _named_separator(decoded(head))
    lines = [line for line in text.splitlines() if line.strip()][:num_lines]
    mark = mark or separator("\n".join(lines))
    return [[cell.strip(' "').lower() for cell in line.split(mark)] for line in lines]


def read_cells(path: Path) -> Rows:
    """The rows that are not blank, each with its line number.

    Raises:
      InputError: the file cannot be read, is no table, or has no rows.
    """
    try:
        content = path.read_bytes()
    except FileNotFoundError:
        raise InputError(f"{path}: no such file") from None
    except OSError as error:
        raise InputError(f"{path}: cannot be read: {error.strerror}") from None
    rows = _split(path, decoded(content))
    if not rows:
        raise InputError(f"{path}: {EMPTY}")
    if all(not any(row[1:]) for _, row in rows) and any(m in rows[0][1][0] for m in SEPARATORS):
        # A spreadsheet that took each line for one cell puts quotes round it, or empty cells after.
        mark = separator(rows[0][1][0])
        rows = [(line, _cells(path, line, row[0], mark)) for line, row in rows]
        rows = [(line, row) for line, row in rows if any(row)]
        if not rows:
            raise InputError(f"{path}: {EMPTY}")
    return rows


def _named_separator(text: str) -> tuple[str | None, str]:
    """The separator that a first line `sep=;` names, and the text with that line empty."""
    first, end, rest = text.partition("\n")
    found = SEPARATOR_LINE.fullmatch(first)
    return (found[1], end + rest) if found else (None, text)


def _split(path: Path, text: str) -> Rows:
    mark, text = _named_separator(text)
    reader = csv.reader(io.StringIO(text), delimiter=mark or separator(text))
    try:
        rows = [(reader.line_num, [cell.strip() for cell in row]) for row in reader]
    except csv.Error as error:
        raise InputError(f"{path}: not a table: line {reader.line_num}: {error}") from None
    return [(line, row) for line, row in rows if any(row)]


def _cells(path: Path, line: int, text: str, mark: str) -> list[str]:
    try:
        return [cell.strip() for cell in next(csv.reader([text], delimiter=mark))]
    except csv.Error as error:
        raise InputError(f"{path}: not a table: line {line}: {error}") from None


def number(text: str) -> float:
    """A cell's number, NaN for an empty one; decimal commas and typographic minus signs are read.

    Raises:
      ValueError: it is no number, or not finite.
    """
    plain = text.replace("\N{MINUS SIGN}", "-").strip()
    if not plain or plain.lower() == "nan":
        return math.nan
    if COMMA_IN_NUMBER.fullmatch(plain):
        plain = plain.replace(",", ".")
    value = float(plain)
    if not math.isfinite(value):
        raise ValueError(text)
    return value


def parse_columns(path: Path, rows: Rows, columns: dict[str, int]) -> dict[str, np.ndarray]:
    """`[row]` for each of the columns, by their title; NaN for an empty or missing cell.

    Raises:
      InputError: a cell is no number, or some numbers have a decimal comma and others a point,
        so that 1,234 may be one or a thousand; names line, column and what stands there.
    """
    parsed = {title: np.full(len(rows), np.nan) for title in columns}
    marked: dict[str, tuple[str, str]] = {}  # the first number with each decimal mark
    for index, (line, row) in enumerate(rows):
        for title, at in columns.items():
            cell = row[at] if at < len(row) else ""
            where = f"line {line}: {title}"
            try:
                parsed[title][index] = number(cell)
            except ValueError:
                raise InputError(
                    f"{path}: {where}: {cell[:40]!r} is not a number; a number such as 0.125 "
                    "expected; leave the cell empty where nothing was seen"
                ) from None
            if mark := _decimal_mark(cell):
                other_mark = "." if mark == "," else ","
                marked.setdefault(mark, (where, cell))
                if other := marked.get(other_mark):
                    raise InputError(
                        f"{path}: {where}: {cell[:40]!r}, but {other[0]}: {other[1][:40]!r}; "
                        "the same decimal mark, point or comma, in the whole file expected"
                    )
    return parsed


def _decimal_mark(cell: str) -> str | None:
    plain = cell.replace("\N{MINUS SIGN}", "-").strip()
    if COMMA_IN_NUMBER.fullmatch(plain):
        return ","
    return "." if POINT_IN_NUMBER.fullmatch(plain) else None
