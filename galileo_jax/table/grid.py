"""Text to a grid of cells: what separates them, quotes, comments, and what a spreadsheet leaves.

A dialect is a separator and a decimal mark. Of all of them the one is taken in which most rows are
numbers, and as many in each row: '20,06; 159,96' and '20,06, 159,96' are two numbers.
"""

import csv
import io
import re
from pathlib import Path

from galileo_jax.runtime.errors import InputError
from galileo_jax.table.clock import is_time
from galileo_jax.table.named_lists import named_lists
from galileo_jax.table.numbers import Rows, is_nothing, is_number
from galileo_jax.table.spreadsheet import MAX_ROWS, is_spreadsheet, spreadsheet_rows
from galileo_jax.table.text import content_of, decoded
from galileo_jax.table.titles import parted_unit
from galileo_jax.table.web_page import web_table

SEPARATORS = ("\t", ";", ",", ", ", "|", " ")
SEPARATOR_LINE = re.compile(r"sep=([\t;,|])\s*", re.IGNORECASE)  # Excel's own first line
COMMENT = re.compile(r"\s*(#+|%+|!+|//)\s?")
QUOTED = re.compile(r'"([^"]*)"')
SAMPLE = 60  # lines that tell the dialect; from the middle on, where no titles are
MAX_CELLS, MAX_LINE = 4_000_000, 200_000
MAX_COLUMNS = 1000
EMPTY = "empty; a row of titles and numbers expected"


def read_cells(path: Path) -> Rows:
    """The cells of a file; as `cells_of`."""
    return cells_of(content_of(path))


def cells_of(content: bytes) -> Rows:
    """The rows that are not blank of a text table, named lists, or a spreadsheet's first sheet.

    Raises:
      InputError: it is no table, or has too many cells.
    """
    if is_spreadsheet(content):
        return _checked(spreadsheet_rows(content))
    if (listed := named_lists(content)) is not None:
        return _checked(listed)
    text = decoded(content)
    if text.lstrip()[:1] == "<":
        return _checked(web_table(text))
    rows = _split(_lines(text))
    is_alone = all(not any(row[1:]) for _, row in rows)
    if is_alone and any(mark in row[0] for _, row in rows for mark in "\t;,"):
        # A spreadsheet that took each line for one cell puts quotes round it, or empty cells after.
        rows = _split([(number, row[0]) for number, row in rows])
    return _checked(rows)


def _lines(text: str) -> list[tuple[int, str]]:
    found = [(n, line) for n, line in enumerate(text.splitlines(), 1) if line.strip()]
    if not found:
        raise InputError(EMPTY)
    if len(found) > MAX_ROWS:
        raise InputError(
            f"{len(found)} rows; at most {MAX_ROWS} expected; keep the part that moves, or "
            "every tenth row"
        )
    number, longest = max(found, key=lambda one: len(one[1]))
    if len(longest) > MAX_LINE:
        raise InputError(f"line {number}: {len(longest)} letters; not a table of a motion")
    return found


def _likely_separator(lines: list[str]) -> str:
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
        values = [parted_unit(cell)[0] or cell for cell in cells]
        numbers = [one for one in values if is_number(one) or is_time(one) or is_nothing(one)]
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
        cells = line.split()
        # Quotes round cells between tabs are those of tabs, and one that is alone is a whole line.
        is_plain = len(cells) > 1 and "\t" not in line
        return [QUOTED.sub(r"\1", cell) for cell in cells] if is_plain else cells
    try:
        row = next(csv.reader([line], delimiter=separator, skipinitialspace=True), [])
    except csv.Error:
        row = line.split(separator)
    return [cell.strip() for cell in row]


def _split(lines: list[tuple[int, str]]) -> Rows:
    named = SEPARATOR_LINE.fullmatch(lines[0][1].strip('\ufeff\r\n"'))
    if named and len(lines) > 1:
        separator, lines = named[1], lines[1:]
    else:
        separator = _likely_separator([line for _, line in lines])
    if separator in (", ", " "):
        rows = [(number, _cells(line, separator)) for number, line in lines]
    else:
        text = io.StringIO("\n".join(line for _, line in lines))
        reader = csv.reader(text, delimiter=separator, skipinitialspace=True)
        try:
            rows = [(lines[min(reader.line_num, len(lines)) - 1][0], [cell.strip() for cell in row])
                    for row in reader]  # fmt: skip
        except csv.Error as error:
            raise InputError(f"not a table: line {reader.line_num}: {error}") from None
    rows = [(line, row) for line, row in rows if any(row)]
    if not rows:
        raise InputError(EMPTY)
    return rows


def _checked(rows: Rows) -> Rows:
    width, count = max(len(row) for _, row in rows), sum(len(row) for _, row in rows)
    for what, found, most in (("columns", width, MAX_COLUMNS), ("cells", count, MAX_CELLS)):
        if found > most:
            raise InputError(f"{found} {what}; at most {most} expected; keep time and place")
    return rows
