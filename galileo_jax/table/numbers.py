"""Cells to numbers: decimal points and commas, thousands marks, exponents, what stands for nothing.

A number printed with so many digits is known to half of the last one: its rounding error has the
standard deviation `unit in the last place / sqrt(12)`.
"""

import math
import re
from dataclasses import dataclass

import numpy as np

from galileo_jax.runtime.errors import InputError

Rows = list[tuple[int, list[str]]]
"""Each row's line number in the file, and its cells."""

NOTHING = frozenset(
    (
        *("", "nan", "-nan", "nan(ind)", "na", "n/a", "n.a.", "<na>", "null", "nil", "none"),
        *("#n/a", "#n/d", "#nv", "?", "-", "--", "---"),
        *("n.d.", "n/d", "nd", "k.a.", "s.d.", "missing", "lost"),
    )
)
"""What programs write where there is no number, lower case."""

PLAIN = re.compile(r"[-+]?(\d+\.?\d*|\.\d+)(e[-+]?\d+)?", re.IGNORECASE)
COMMA = re.compile(r"[-+]?(\d+,\d+|,\d+)(e[-+]?\d+)?", re.IGNORECASE)
FORTRAN = re.compile(r"(?<=[\d.])d(?=[-+]?\d+$)", re.IGNORECASE)
"""The exponent of a number in double precision: 1.5D-03."""

LARGEST = 1e20  # of a number: as many nanoseconds are 3,000 years
PLAIN_LETTERS = frozenset("0123456789.+-eE")
MOST_LOOKED_AT = 500  # rows: a column is of one kind, and printed in one way
GROUPED = re.compile(r"[-+]?\d{1,3}(?:([,.' ])\d{3})(?:\1\d{3})*(?:([.,])\d*)?")
"""1,234.5 and 1.234,5: digits in groups of three."""

SPACES = dict.fromkeys(map(ord, "\u00a0\u2009\u202f"), " ") | {0x2212: "-", 0x2019: "'"}


@dataclass(frozen=True)
class Numbers:
    """A column of numbers."""

    values: np.ndarray  # `[row]`, NaN where there is none
    # unit in the last place as printed, median over the rows; NaN where there is no number but 0
    resolution: float

    @property
    def seen(self) -> np.ndarray:
        """The numbers that are there, `[one]`."""
        return self.values[np.isfinite(self.values)]

    @property
    def steps(self) -> np.ndarray:
        """From each number that is there to the next."""
        return np.diff(self.seen)


def plain(cell: str) -> str:
    """A cell without typographic spaces and minus signs, its exponent after an e."""
    return FORTRAN.sub("e", cell.translate(SPACES).strip().strip("'"))


def is_nothing(cell: str) -> bool:
    """Whether a cell stands for no number, as a spreadsheet's errors do: #VALUE!, #¿NOMBRE?."""
    text = plain(cell).lower()
    return text in NOTHING or (text[0] == "#" and text[-1] in "!?")


def is_number(cell: str) -> bool:
    """Whether a cell is a number, with whatever decimal and thousands marks."""
    text = plain(cell)
    return bool(
        text and (PLAIN.fullmatch(text) or COMMA.fullmatch(text) or _grouped(text) is not None)
    )


def _grouped(text: str) -> tuple[str, str | None] | None:
    """(thousands mark, decimal mark) of a number in groups of three that can be nothing else."""
    match = GROUPED.fullmatch(text)
    if match is None or match[1] == match[2]:
        return None
    is_certain = match[2] is not None or text.count(match[1]) > 1 or match[1] in "' "
    return (match[1], match[2]) if is_certain else None


def decimal_mark(rows: Rows, columns: dict[str, int]) -> tuple[str, str | None]:
    """The decimal mark of all the columns, and the thousands mark, if there is one.

    Raises:
      InputError: some numbers have a comma and others a point, so that 1,234 may be one or a
        thousand; names the lines and columns.
    """
    marked: dict[str, tuple[str, str]] = {}  # the first number with each decimal mark
    thousands: str | None = None
    mixed = {}
    for title, at in columns.items():
        cells = _cells(rows, at)
        if not _are_plain(cells):
            mixed[title] = at
        elif (n := next((n for n, cell in enumerate(cells) if "." in cell), None)) is not None:
            marked.setdefault(".", (f"line {rows[n][0]}: {title}", cells[n]))
    for line, row in rows if mixed else ():
        for title, at in mixed.items():
            cell = row[at] if at < len(row) else ""
            if cell.isdigit() or ("." in marked and "," not in cell and PLAIN.fullmatch(cell)):
                continue
            cell = plain(cell)
            if (grouped := _grouped(cell)) is not None:
                thousands, found = grouped
                found = found or {",": ".", ".": ","}.get(thousands)
            elif PLAIN.fullmatch(cell):
                found = "." if "." in cell else None
            else:
                found = "," if COMMA.fullmatch(cell) else None
            if found is not None:
                marked.setdefault(found, (f"line {line}: {title}", cell))
    if len(marked) == 2 and thousands in (",", "."):
        decimal = "." if thousands == "," else ","
        _where, cell = marked[thousands]
        if GROUPED.fullmatch(cell):
            return decimal, thousands
    if len(marked) == 2:
        (first, one), (second, other) = marked["."], marked[","]
        raise InputError(
            f"{second}: {other[:40]!r}, but {first}: {one[:40]!r}; "
            "the same decimal mark, point or comma, in the whole file expected"
        )
    return ("," if "," in marked else "."), thousands


def parse_columns(rows: Rows, columns: dict[str, int]) -> dict[str, Numbers]:
    """The numbers of each of the columns, by title.

    Raises:
      InputError: a cell is no number, or decimal marks differ; names line, column and cell.
    """
    decimal, thousands = decimal_mark(rows, columns)
    return {title: _column(rows, title, at, decimal, thousands)
            for title, at in columns.items()}  # fmt: skip


def values_of(rows: Rows, columns: dict[str, int]) -> dict[str, np.ndarray]:
    """The values of `parse_columns` alone, `[row]` for each title."""
    return {title: one.values for title, one in parse_columns(rows, columns).items()}


def _column(rows: Rows, title: str, at: int, decimal: str, thousands: str | None) -> Numbers:
    cells = _cells(rows, at)
    if decimal == "." and _are_plain(cells) and (quick := _at_once(cells)) is not None:
        return Numbers(quick, _resolution(cells, quick))
    values, written = np.full(len(rows), np.nan), [""] * len(rows)
    for index, ((line, row), cell) in enumerate(zip(rows, cells, strict=True)):
        if not PLAIN.fullmatch(cell):
            if is_nothing(cell):
                continue
            cell = plain(cell)
            if thousands is not None:
                cell = cell.replace(thousands, "")
            if decimal == ",":
                cell = cell.replace(",", ".")
        value = float(cell) if PLAIN.fullmatch(cell) else math.inf
        if not abs(value) < LARGEST:
            why = "is larger than anything" if math.isfinite(value) else "is not a number"
            raise InputError(
                f"line {line}: {title}: {row[at][:40]!r} {why}; a number such as "
                "0.125 expected; leave the cell empty where nothing was seen"
            )
        values[index], written[index] = value, cell
    return Numbers(values, _resolution(written, values))


def _cells(rows: Rows, at: int) -> list[str]:
    return [row[at] if at < len(row) else "" for _, row in rows]


def _are_plain(cells: list[str]) -> bool:
    """Whether there is nothing but digits, points, signs and exponents in a column."""
    return PLAIN_LETTERS.issuperset("".join(cells))


def _at_once(cells: list[str]) -> np.ndarray | None:
    """The numbers of a plain column; None where one of its cells is none."""
    try:
        values = np.array(cells, dtype=float)
    except ValueError:
        return None
    return values if (abs(values) < LARGEST).all() else None


def _resolution(cells: list[str], values: np.ndarray) -> float:
    """The median unit in the last place of the numbers but 0, of `MOST_LOOKED_AT` at most."""
    there = np.flatnonzero(np.isfinite(values) & (values != 0))
    there = there[:: max(1, len(there) // MOST_LOOKED_AT)]
    return float(np.median([_last_place(cells[n]) for n in there])) if there.size else math.nan


def _last_place(text: str) -> float:
    """The unit in the last place of a printed number: 1.20E-2 is known to 1e-4."""
    mantissa, _, exponent = text.lower().partition("e")
    digits = len(mantissa.partition(".")[2])
    return 10.0 ** min((int(exponent) if exponent else 0) - digits, 300)
