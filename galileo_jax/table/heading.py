"""What stands above the numbers: titles, units in a row of their own, names of objects.

mass_A            or   #multi:                 or   Pointages    or   scorer,DLC,DLC
t,x,y                  ,mass A,,mass B,             t;x;y             bodyparts,block,block
0.0,1.2E-2,-3.0E-3     t,x,y,x,y                    (s);(m);(m)       coords,x,y
"""

import re
import statistics
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import chain, pairwise, permutations

from galileo_jax.runtime.errors import InputError
from galileo_jax.table.clock import is_time
from galileo_jax.table.grid import COMMENT
from galileo_jax.table.numbers import MOST_LOOKED_AT, Rows, is_nothing, is_number
from galileo_jax.table.titles import (
    LENGTHS,
    Title,
    is_of_all_rows,
    is_turning,
    parted_unit,
    title_of,
    unit_of,
)

MULTI = "multi:"
DIGITS = re.compile(r"\s*\d+")  # by which runs are told apart: "s1 (cm)", "s 2 (cm)"
AXES = ("x", "y", "z")
RATES = (
    *("frequency", "fps", "frame rate", "framerate", "sampling rate"),
    *("export frame rate", "capture frame rate", "datarate", "camerarate"),
)
UNIT_OF_LENGTH = ("units", "unit", "length units", "length unit", "y_unit_label")
END_OF_HEADER = "***"  # LabVIEW's line between its header and the table
NEAR_TITLES = 3  # rows: so near above the titles stand numbers of bodies
MARKERS = "marker_names"  # motion capture: three columns for each of the names that follow


@dataclass(frozen=True)
class Heading:
    """The part above the numbers, and the numbers."""

    titles: tuple[str, ...]  # one for each column, as the file has it; "" where it has none
    meanings: tuple[Title, ...]  # the titles taken apart, with units and names from other rows
    body: Rows  # the rows of numbers
    is_titled: bool  # whether a title was understood
    frame_s: float | None = None  # between two rows, s, where the heading tells it

    def name_of(self, n: int) -> str:
        """What messages call a column; no two are the same."""
        title = self.titles[n]
        is_alone = title and self.titles.count(title) == 1
        return title if is_alone else f"{title} (column {n + 1})" if title else f"column {n + 1}"


def split_heading(rows: Rows) -> Heading:
    """Parts the titles from the numbers.

    Raises:
      InputError: there are no numbers, or a row has more cells than titles.
    """
    rows = _units_in_a_row(_upright(rows))
    width = max(len(row) for _, row in rows)
    later = [row for _, row in rows[len(rows) // 2 :][:MOST_LOOKED_AT]]
    words = _word_columns(later, width)
    usual = statistics.median(sum(map(bool, row)) for row in later)  # filled cells
    start = next(
        (n for n, (_, row) in enumerate(rows)
         if _is_body(row, words) and 2 * sum(map(bool, row)) > usual and not COMMENT.match(row[0])
         and not _first_titles_below(rows, n)), None)  # fmt: skip
    if start is None:
        raise InputError(
            f"no row of numbers; line {rows[0][0]} has {_listed(rows[0][1])}; a time and a "
            "place in columns expected, such as t (s), x (m), y (m)"
        )
    commented = {line for line, row in rows[:start] if COMMENT.match(row[0])}
    above = [(line, _uncommented(row)) for line, row in rows[:start]]
    body = [(line, row) for line, row in rows[start:] if not COMMENT.match(row[0])]
    while _is_below(body):
        body.pop()
    counts = [_num_titles(row) for _, row in above]
    if max(counts, default=0) < 2:
        above = _listed_titles(above, max(len(row) for _, row in body)) or above
        above += _marker_titles(above)
        counts = [_num_titles(row) for _, row in above]
    at = max(range(len(counts)), key=lambda n: (counts[n], n), default=-1)
    if at < 0 or not counts[at]:
        # Titles in words that are not known are the last row that fills the columns; a comment
        # is none unless it has a cell for each.
        filled = max(len(row) for _, row in body)
        at = max((n for n, (line, row) in enumerate(above) if sum(map(bool, row)) >= min(width, 2)
                  and not (_is_units(row) or _has_number(row))
                  and (line not in commented or len(row) == filled)), default=-1)  # fmt: skip
    below = (n for n in range(at + 1, len(above)) if above[n][0] not in commented)
    cut = next((n for n in below if at >= 0 and _has_number(above[n][1])), None)
    if cut is not None:  # a bad cell in the first row of numbers
        above, body = above[:cut], [*rows[cut:start], *body]
    titles = (above[at][1] if at >= 0 else []) + [""] * width
    if at >= 0 and _has_row_names(above[at][1], body):
        titles = ["", *titles]
    body = [(line, row) for line, row in body if at < 0 or row != above[at][1]]
    titles = _with_clock_above(titles, [row for _, row in above[: max(at, 0)]])
    units = next((row for _, row in above if _is_units(row)), [])
    ends = [n for n, (_, row) in enumerate(above) if "".join(row[:1]).startswith(END_OF_HEADER)]
    over = [
        row
        for line, row in above[max(ends, default=-1) + 1 : max(at, 0)]
        if not (_is_units(row) or _has_number(row) or line in commented)
        and not _is_titles_again(row, titles)
    ]
    if at >= 0:
        _check_lengths(body, words, [titles, *over])
    names = _names(over, width)
    told = next((cell for cell in _beside(above, UNIT_OF_LENGTH) if unit_of(cell) in LENGTHS), "")
    meanings = []
    for n, text in enumerate(titles[:width]):
        meaning = title_of(text)
        if meaning.unit is None and n < len(units) and units[n]:
            meaning = replace(meaning, unit=unit_of(units[n]))
        if meaning.unit is None and told and meaning.role in AXES:
            meaning = replace(meaning, unit=unit_of(told))
        if not meaning.name and n < len(names) and meaning.role not in ("time", "frame"):
            meaning = replace(meaning, name=names[n])
        if any(n < len(row) and is_turning(row[n]) for row in over):
            meaning = replace(meaning, role="")  # motion capture: of a rotation, 'X' is none
        meanings.append(meaning)
    is_titled = any(one.role for one in meanings)
    return Heading(tuple(titles[:width]), tuple(meanings), body, is_titled, _frame_s(above))


def _upright(rows: Rows) -> Rows:
    """The rows, or of a table that lies on its side the columns: each of its rows has a title."""
    if len(rows) >= len(rows[0][1]) or len({len(row) for _, row in rows}) > 1:
        return rows
    columns = list(zip(*(row for _, row in rows), strict=True))
    is_timed = any(title_of(title).role in ("time", "frame") for title in columns[0])
    if not is_timed or not all(_is_value(one) or is_nothing(one) for one in chain(*columns[1:])):
        return rows
    return [(n, list(cells)) for n, cells in enumerate(columns, 1)]


def _units_in_a_row(rows: Rows) -> Rows:
    """The rows with units that stand behind every number of a column in a row of their own."""
    body = [row for _, row in rows[len(rows) // 2 :][:MOST_LOOKED_AT]]
    behind: dict[int, str] = {}
    for n in range(max(map(len, body))):
        units = {parted_unit(row[n])[1] for row in body if n < len(row) and not is_nothing(row[n])}
        if len(units) == 1 and (unit := units.pop()):
            behind[n] = unit

    if not behind:
        return rows

    def bare(row: list[str]) -> list[str]:
        return [(n in behind and parted_unit(cell)[0]) or cell for n, cell in enumerate(row)]

    found = [(line, bare(row)) for line, row in rows]
    first = next(n for n, (_, row) in enumerate(rows) if found[n][1] != row)
    units = (found[first][0], [behind.get(n, "") for n in range(max(behind) + 1)])
    return [*found[:first], units, *found[first:]]


def one_below_the_other(heading: Heading, num_bodies: int = 1) -> Heading:
    """Runs that stand side by side, each with its own times, as motions that follow each other.

    Their columns mean the same in the same order. They are runs if one body moves, if a data set's
    name stands before a colon, or if their times differ; columns of named bodies only if no clock
    goes on in another, or each has one coordinate.
    """
    used = [n for n, title in enumerate(heading.titles) if title]
    parted = [_parted(heading.titles[n]) for n in used]  # data set and words
    kinds = [_kind(heading.meanings[n], one) for n, (_, one) in zip(used, parted, strict=True)]
    may_be = (n for n in range(2, len(kinds) // 2 + 1) if len(kinds) % n == 0)
    width = next((n for n in may_be if kinds == kinds[:n] * (len(kinds) // n)), 0)
    own = tuple(replace(heading.meanings[n], name="") for n in used[:width])
    clock = next((n for n, one in enumerate(own) if one.role == "time"), None)
    if clock is None:
        return heading
    blocks = [used[n : n + width] for n in range(0, len(used), width)]
    each = [
        [
            (line, cells)
            for line, row in heading.body
            if any(cells := [row[n] if n < len(row) else "" for n in block])
        ]
        for block in blocks
    ]
    times = [[cells[clock] for _, cells in block] for block in each]
    if any(heading.meanings[n].name for n in used):
        is_run = all(set(one) - set(other) for one, other in permutations(times, 2)) or width == 2
    else:
        is_run = num_bodies == 1 or len({one for one, _ in parted}) == len(blocks)
        is_run |= times != times[:1] * len(blocks)
    if not is_run:
        return heading
    titles = tuple(words for _, words in parted[:width])
    return replace(heading, titles=titles, meanings=own, body=[*chain(*each)])


def _parted(title: str) -> tuple[str, str]:
    """The data set's name, before a colon, and the rest of a title."""
    data_set, _, rest = title.rpartition(":")
    return data_set, rest.strip()


def _kind(meaning: Title, words: str) -> tuple[str, str | None]:
    """What a column is, whichever run it is of: its role, or else its words; and its unit."""
    return meaning.role or DIGITS.sub("", words).lower(), meaning.unit


def _has_row_names(titles: list[str], body: Rows) -> bool:
    """Whether each row has one cell more than there are titles, the first of which is its name.

    As R's write.table numbers them, from 1 on.
    """
    names = [row[0] for _, row in body]
    is_longer = all(titles) and all(len(row) == len(titles) + 1 for _, row in body)
    return is_longer and names == [str(n) for n in range(1, len(body) + 1)]


def _num_titles(row: list[str]) -> int:
    """How many cells are known titles; 0 of a row of units, or of a word and its value."""
    if _is_units(row) or _has_number(row):
        return 0
    return sum(bool(title_of(cell).role) for cell in row)


def _is_titles_again(row: list[str], titles: list[str]) -> bool:
    """Whether a row has the same titles in other words (TrackMate), two axes at least."""
    pairs = ((title_of(a).role, title_of(b).role) for a, b in zip(row, titles, strict=False))
    return sum(one == other and one in AXES for one, other in pairs) > 1


def _with_clock_above(titles: list[str], above: list[list[str]]) -> list[str]:
    """The titles, with those of a clock that stand in a row above where there is none."""
    found = list(titles)
    for row in above:
        for n, cell in enumerate(row[: len(titles)]):
            if not titles[n] and title_of(cell).role in ("time", "frame"):
                found[n] = cell
    return found


def _is_value(cell: str) -> bool:
    return is_number(cell) or is_time(cell)


def _is_below(body: Rows) -> bool:
    """Whether the last row is a remark below the table, or the mean of a column.

    Whatever the language, a word begins it, below an empty row.
    """
    line, row = body[-1]
    is_apart = len(body) > 1 and line - body[-2][0] > 1
    is_word = bool(row[0]) and not _has_number(row[:1])
    return not _has_number(row) or is_of_all_rows(row[0]) or (is_apart and is_word)


def _has_number(row: list[str]) -> bool:
    return any(map(_is_value, row))


def _word_columns(rows: list[list[str]], width: int) -> set[int]:
    """Columns of words: labels that most rows have."""
    found = set()
    for n in range(width):
        cells = [row[n] for row in rows if n < len(row) and not is_nothing(row[n])]
        if cells and sum(map(_is_value, cells)) < len(cells) / 2:
            found.add(n)
    return found


def _is_body(row: list[str], words: set[int]) -> bool:
    cells = [cell for n, cell in enumerate(row) if n not in words and cell]
    return _has_number(cells) and all(_is_value(cell) or is_nothing(cell) for cell in cells)


def _uncommented(row: list[str]) -> list[str]:
    first = row[0][match.end() :] if (match := COMMENT.match(row[0])) else row[0]
    return row[1:] if not first and row[0] else [first, *row[1:]]


def _is_units(row: list[str]) -> bool:
    cells = [cell for cell in row if cell.strip("()[] -")]
    known = [unit_of(cell) is not None for cell in cells]
    return bool(known) and sum(known) > len(known) / 2 and "t" not in [c.lower() for c in cells]


def _marker_titles(above: Rows) -> Rows:
    """A row with titles for the three columns of each marker, where only the markers are named."""
    found = [(line, row[1:]) for line, row in above if row and row[0].lower() == MARKERS]
    return [(line, [f"{name} {axis}" for name in names if name for axis in "XYZ"])
            for line, names in found[:1]]  # fmt: skip


def _listed_titles(above: Rows, width: int) -> Rows:
    """Rows of titles and of units where each stands in a line of its own, as Regressi has them."""
    runs = []
    for first in range(len(above) - width + 1):
        part = above[first : first + width]
        if width > 1 and all(len(row) == 1 for _, row in part):
            runs.append((part[-1][0], [row[0] for _, row in part]))
    titles = next((run for run in runs if _num_titles(run[1]) > 1), None)
    units = next((run for run in runs if _is_units(run[1])), None)
    return [] if titles is None else [run for run in (titles, units) if run is not None]


def _first_titles_below(rows: Rows, n: int) -> bool:
    """Whether titles, two or more in a row, stand soon below row n, and none above it."""
    above, below = rows[:n], rows[n + 1 : n + 1 + NEAR_TITLES]
    titled = [[_num_titles(row) > 1 for _, row in part] for part in (above, below)]
    return any(titled[1]) and not any(titled[0])


def _check_lengths(body: Rows, words: set[int], heading: list[list[str]]) -> None:
    """Refuses a row that has cells beyond the titles, the first row of the `heading`, and names."""

    def num_used(row: list[str]) -> int:
        return max((n + 1 for n, cell in enumerate(row) if cell and n not in words), default=0)

    line, row = max(body, key=lambda one: (num_used(one[1]), -one[0]))
    titles = heading[0]
    named = max((n + 1 for row in heading for n, title in enumerate(row) if title), default=0)
    if num_used(row) <= named:
        return
    hint = "give every column a title"
    if all(cell.lstrip("+-").isdigit() for cell in row if cell):
        hint = (
            "is the comma used twice, in numbers and between them? write decimal points, or "
            "semicolons between the cells"
        )
    raise InputError(
        f"line {line}: {len(row)} cells for {named} titles ({_listed(titles)}); {hint}"
    )


def _listed(cells: list[str]) -> str:
    shown = [repr(cell[:20]) for cell in cells if cell]
    return ", ".join(shown[:6]) + (", ..." if len(shown) > 6 else "")


def _names(rows: list[list[str]], width: int) -> list[str]:
    """The object's name over each column: a name stands over its first column, or over each."""
    filled = []
    for row in rows:
        if not any(row) or row[0].lower().lstrip("#") == MULTI:
            continue
        names = []
        last = next(filter(None, row)) if sum(map(bool, row)) == 1 else ""  # of one object
        for n in range(width):
            last = row[n] if n < len(row) and row[n] else last
            names.append(last.replace("_", " "))
        filled.append(names)
    varied = [names for names in filled if len(set(names[1:])) > 1]
    chosen = varied or filled[-1:]
    return [" ".join(dict.fromkeys(parts)) for parts in zip(*chosen, strict=True)]


def _beside(above: Rows, keys: Sequence[str]) -> Iterator[str]:
    """What stands right of each key, and what stands below it."""
    for row, below in pairwise([*(row for _, row in above), []]):
        for n in (n for n, cell in enumerate(row) if cell.lower().strip(":= ") in keys):
            yield from row[n + 1 : n + 2]
            yield from below[n : n + 1]


def _frame_s(above: Rows) -> float | None:
    cells = (cell for key in RATES for cell in _beside(above, (key,)))
    rate = next((float(cell.replace(",", ".")) for cell in cells if is_number(cell)), 0.0)
    return 1 / rate if rate > 0 else None
