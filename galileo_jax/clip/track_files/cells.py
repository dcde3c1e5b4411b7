"""Text tables as spreadsheets and laboratory programs write them: rows of cells, and numbers."""

import csv
import io
import math
import re
from pathlib import Path

import numpy as np

from galileo_jax.runtime.errors import InputError

SEPARATORS = ("\t", ";", ",")
COMMA_IN_NUMBER = re.compile(r"[-+]?\d+,\d*(e[-+]?\d+)?", re.IGNORECASE)


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
    text = decoded(head)
    lines = [line for line in text.splitlines() if line.strip()][:num_lines]
    mark = separator("\n".join(lines))
    return [[cell.strip(' "').lower() for cell in line.split(mark)] for line in lines]


def read_cells(path: Path) -> list[tuple[int, list[str]]]:
    """The rows that are not blank, each with its line number.

    Raises:
      InputError: the file cannot be read, is no table, or has no rows.
    """
    try:
        text = decoded(path.read_bytes())
    except OSError as error:
        raise InputError(f"{path}: cannot be read: {error.strerror}") from None
    reader = csv.reader(io.StringIO(text), delimiter=separator(text))
    try:
        rows = [(reader.line_num, [cell.strip() for cell in row]) for row in reader]
    except csv.Error as error:
        raise InputError(f"{path}: not a table: line {reader.line_num}: {error}") from None
    rows = [(line, row) for line, row in rows if any(row)]
    if not rows:
        raise InputError(f"{path}: empty; a row of titles and numbers expected")
    return rows


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


def parse_columns(
    path: Path, rows: list[tuple[int, list[str]]], columns: dict[str, int]
) -> dict[str, np.ndarray]:
    """`[row]` for each of the columns, by their title; NaN for an empty or missing cell.

    Raises:
      InputError: a cell is no number; names line, column and what stands there.
    """
    parsed = {title: np.full(len(rows), np.nan) for title in columns}
    for index, (line, row) in enumerate(rows):
        for title, at in columns.items():
            cell = row[at] if at < len(row) else ""
            try:
                parsed[title][index] = number(cell)
            except ValueError:
                raise InputError(
                    f"{path}: line {line}: {title}: {cell[:40]!r} is not a number; "
                    "leave the cell empty where nothing was seen"
                ) from None
    return parsed
