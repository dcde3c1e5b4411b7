"""Text to a grid of cells: what separates them, quotes, comments, and what a spreadsheet leaves.

A dialect is a separator and a decimal mark. Of all of them the one is taken in which most rows are
numbers, and as many in each row: '20,06; 159,96' and '20,06, 159,96' are two numbers.
"""

import csv
import io
import re
from dataclasses import dataclass
from pathlib import Path

from galileo_jax.runtime.errors import InputError
from galileo_jax.table.clock import is_time
from galileo_jax.table.numbers import Rows, is_nothing, is_number
from galileo_jax.table.spreadsheet import is_spreadsheet, spreadsheet_rows
from galileo_jax.table.text import content_of, decoded
from galileo_jax.table.titles import count_words

SEPARATORS = ("\t", ";", ",", ", ", "|", " ")
SEPARATOR_LINE = re.compile(r"sep=([\t;,|])\s*", re.IGNORECASE)  # Excel's own first line
COMMENT = re.compile(r"\s*(#+|%+|//)\s?")
SAMPLE = 60
"""Lines that tell the dialect; from the middle on, where no titles are."""

MAX_ROWS, MAX_CELLS, MAX_LINE = 200_000, 4_000_000, 200_000
MAX_COLUMNS = 1000
EMPTY = "empty; a row of titles and numbers expected"


@dataclass(frozen=True)
class Grid:
    """The cells of a file.

    Attributes:
      rows: that are not blank, with their line numbers.
      separator: between cells; "" of a spreadsheet.
    """

    rows: Rows
    separator: str = ""


def read_grid(path: Path) -> Grid:
    """The cells of a text table or of a spreadsheet's first sheet with numbers.

    Raises:
      InputError: the file cannot be read, is no table, or has too many cells.
    """
    path = Path(path)
    content = content_of(path)
    if is_spreadsheet(content):
        return Grid(_checked(path, spreadsheet_rows(path, content)))
    text = decoded(path, content, count_words)
    lines = _lines(path, text)
    separator = _named(lines) or _separator([line for _, line in lines])
    rows = _split(path, lines, separator)
    if all(not any(row[1:]) for _, row in rows) and any(
        m in row[0] for _, row in rows for m in "\t;,"
    ):
        # A spreadsheet that took each line for one cell puts quotes round it, or empty cells after.
        lines = [(number, row[0]) for number, row in rows]
        separator = _named(lines) or _separator([line for _, line in lines])
        rows = _split(path, lines, separator)
    return Grid(_checked(path, rows), separator)


def read_cells(path: Path) -> Rows:
    """The rows that are not blank, each with its line number; as `read_grid`."""
    return read_grid(path).rows


def _lines(path: Path, text: str) -> list[tuple[int, str]]:
    found = [(n, line) for n, line in enumerate(text.splitlines(), 1) if line.strip()]
    if not found:
        raise InputError(f"{path}: {EMPTY}")
    if len(found) > MAX_ROWS:
        raise InputError(
            f"{path}: {len(found)} rows; at most {MAX_ROWS} expected; keep the part that moves, or "
            "every tenth row"
        )
    number, longest = max(found, key=lambda one: len(one[1]))
    if len(longest) > MAX_LINE:
        raise InputError(f"{path}: line {number}: {len(longest)} letters; not a table of a motion")
    return found


def _named(lines: list[tuple[int, str]]) -> str | None:
    """The separator that a first line `sep=;` names; takes that line out."""
    found = SEPARATOR_LINE.fullmatch(lines[0][1].strip('\ufeff\r\n"'))
    if found is None or len(lines) < 2:
        return None
    del lines[0]
    return found[1]


def _separator(lines: list[str]) -> str:
    """The separator in which most of the lines in the middle are as many numbers each."""
    lines = [line for line in lines if not COMMENT.match(line)] or lines
    sample = lines[len(lines) // 2 :][:SAMPLE]
    best = max(SEPARATORS, key=lambda one: (_fit(sample, one), -SEPARATORS.index(one)))
    if _fit(sample, best)[0] > 0:
        return best
    return next((mark for mark in "\t;," if mark in "".join(sample)), ",")


def _fit(lines: list[str], separator: str) -> tuple[float, int, float]:
    """How well a separator fits: the larger, the better.

    Share of rows that are numbers and no more than usual; which of two that fit is meant; share of
    cells that are numbers.
    """
    rows = [_cells(line, separator) for line in lines]
    filled = [n for row in rows if (n := sum(map(bool, row))) > 1]
    if not filled or (separator == ", " and not _is_comma_twice(rows)):
        return 0.0, 0, 0.0
    usual = max(sorted(set(filled)), key=filled.count)
    good, num_cells, num_numbers = 0, 0, 0
    for row in rows:
        cells = [cell for cell in row if cell]
        numbers = [cell for cell in cells if is_number(cell) or is_time(cell) or is_nothing(cell)]
        least = len(cells) if separator == " " else max(1, len(cells) / 2)  # words have spaces
        num_cells, num_numbers = num_cells + len(cells), num_numbers + len(numbers)
        good += len(cells) <= usual and len(numbers) >= least
    # A comma with a space, where it fits, is told by every cell's own decimal comma.
    meant = 2 if separator == ", " else 1
    return round(good / len(rows), 2), meant, round(num_numbers / num_cells, 2)


def _is_comma_twice(rows: list[list[str]]) -> bool:
    """Whether every row has a decimal comma in all cells but those of one column of counts."""
    commas = [[("," in cell) for cell in row] for row in rows if all(row)]
    return bool(commas) and all(sum(one) >= max(1, len(one) - 1) for one in commas)


def _cells(line: str, separator: str) -> list[str]:
    if separator == ", ":
        return [cell.strip().strip('"').strip() for cell in re.split(r",\s+", line.strip())]
    if separator == " ":
        return line.split()
    try:
        row = next(csv.reader([line], delimiter=separator, skipinitialspace=True), [])
    except csv.Error:
        row = line.split(separator)
    return [cell.strip() for cell in row]


def _split(path: Path, lines: list[tuple[int, str]], separator: str) -> Rows:
    if separator in (", ", " "):
        rows = [(number, _cells(line, separator)) for number, line in lines]
    else:
        text = io.StringIO("\n".join(line for _, line in lines))
        reader = csv.reader(text, delimiter=separator, skipinitialspace=True)
        try:
            rows = [(lines[min(reader.line_num, len(lines)) - 1][0], [cell.strip() for cell in row])
                    for row in reader]  # fmt: skip
        except csv.Error as error:
            raise InputError(f"{path}: not a table: line {reader.line_num}: {error}") from None
    rows = [(line, row) for line, row in rows if any(row)]
    if not rows:
        raise InputError(f"{path}: {EMPTY}")
    return rows


def _checked(path: Path, rows: Rows) -> Rows:
    if (width := max(len(row) for _, row in rows)) > MAX_COLUMNS:
        raise InputError(
            f"{path}: {width} columns; at most {MAX_COLUMNS} expected; keep time and place"
        )
    if (count := sum(len(row) for _, row in rows)) > MAX_CELLS:
        raise InputError(
            f"{path}: {count} cells; at most {MAX_CELLS} expected; keep time and place"
        )
    return rows
