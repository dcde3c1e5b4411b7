"""Times as people and programs write them: seconds, m:s, h:m:s:frames, dates, to seconds.

Of dates in any order of day and month the day has to be the same in all rows, and counts no more.

Dates and clocks are counted from the first row on before anything is rounded.
"""

import math
import re
from datetime import UTC, datetime

import numpy as np

from galileo_jax.runtime.errors import InputError
from galileo_jax.table.numbers import Numbers, Rows, is_nothing

CLOCK = re.compile(r"(?:(\d{1,4}):)?(\d{1,4}):(\d{1,2})(?:[.,](\d+))?")
FIELDS = re.compile(r"(\d{1,3}):(\d{1,2}):(\d{1,2})[:;](\d{1,3})")
DATE = re.compile(r"\d{4}-\d{2}-\d{2}[T ]\d{2}:\d{2}(:\d{2}([.,]\d+)?)?\s?(Z|[+-]\d{2}:?\d{2})?")
DAY = re.compile(r"(?:(\d{1,4}([./-])\d{1,2}\2\d{1,4}),?[T ]\s*)?([\d:.,]+)\s*([AaPp]\.?[Mm]\.?)?")
"""Another date than `DATE`, its day, clock, and half of the day: 14.05.2024 09:31:02,033."""

DAY_S = 86400.0
SAME_RATE = 0.1  # of a rate, by which hundredths from row to row may tell another
LIKE_STEPS = 0.3  # of a step: by more rounding to milliseconds moves none of 240 a second
COMMON_FPS = (24, 25, 30, 48, 50, 60, 100, 120, 240)


def is_time(cell: str) -> bool:
    """Whether a cell is a date or a clock, not a plain number."""
    return ":" in cell and any(form.fullmatch(cell) for form in (CLOCK, FIELDS, DATE, DAY))


def clock_times(rows: Rows, title: str, at: int, fps: float | None) -> Numbers | None:
    """Seconds from the first row on of a column of dates or clocks; None: it has none.

    Raises:
      InputError: a cell is of another form than the first; or whether the last of four fields
        counts frames or hundredths cannot be told.
    """
    cells = [(line, row[at] if at < len(row) else "") for line, row in rows]
    first = next((cell for _, cell in cells if not is_nothing(cell)), "")
    is_plain = any(one.fullmatch(first) for one in (FIELDS, CLOCK, DATE))
    if is_time(first) and not is_plain:
        cells = [
            (line, _clock_of_day(cell, first, f"line {line}: {title}")) for line, cell in cells
        ]
        first = next(cell for _, cell in cells if cell)
    form = next((one for one in (FIELDS, CLOCK, DATE) if one.fullmatch(first)), None)
    if form is None:
        return None
    parsed = [form.fullmatch(cell) for _, cell in cells]
    for (line, cell), match in zip(cells, parsed, strict=True):
        if match is None and not is_nothing(cell):
            raise InputError(
                f"line {line}: {title}: {cell[:40]!r} is not a time such as {first[:40]!r}"
            )
    try:
        if form is DATE:
            return _dates(parsed)
    except ValueError as error:
        raise InputError(f"{title}: {error}; a date such as {first[:40]!r} expected") from None
    whole = np.array([np.nan if m is None else _seconds(m) for m in parsed])
    last = ["" if m is None else m[4] or "" for m in parsed]
    if form is CLOCK:
        digits = max(map(len, last))
        return _from_first(whole + [float(f"0.{part or 0}") for part in last], 10.0**-digits)
    counted = np.array([float(part or "nan") for part in last])
    parts = _parts_of_second(whole, counted, fps)
    if parts is None:
        raise InputError(
            f"{title}: {first!r}: whether its last field counts frames or hundredths of a "
            "second is not told; write seconds, such as 0.125"
        )
    return _from_first(whole + counted / parts, 1.0 / parts)


def _clock_of_day(cell: str, first: str, where: str) -> str:
    """A date's clock; "" where there is none.

    Raises:
      InputError: it is of another half day than the first one's.
    """
    if is_nothing(cell):
        return ""
    usual, found = DAY.fullmatch(first), DAY.fullmatch(cell)
    if usual is None or found is None or found.group(1, 4) != usual.group(1, 4):
        raise InputError(
            f"{where}: {cell[:40]!r} is no time of the same half day as {first[:40]!r}; write "
            "seconds, such as 0.125"
        )
    return f"{found[3]}:00" if found[3].count(":") == 1 else found[3]  # hours and minutes


def _seconds(match: re.Match[str]) -> float:
    return 3600.0 * int(match[1] or 0) + 60.0 * int(match[2]) + int(match[3])


def _dates(parsed: list[re.Match[str] | None]) -> Numbers:
    moments = [m and datetime.fromisoformat(m[0].replace(",", ".")) for m in parsed]
    moments = [m if m is None or m.tzinfo else m.replace(tzinfo=UTC) for m in moments]
    start = next(m for m in moments if m is not None)
    values = [np.nan if m is None else (m - start).total_seconds() for m in moments]
    digits = max(len((m[2] or ".")[1:]) for m in parsed if m)
    return Numbers(np.array(values), 10.0**-digits)


def _from_first(values: np.ndarray, resolution: float) -> Numbers:
    """Seconds from the first one on, over midnight, too."""
    seen, found = np.isfinite(values), np.full_like(values, np.nan)
    found[seen] = np.unwrap(values[seen], period=DAY_S)
    return Numbers(found - (found[seen][0] if seen.any() else 0.0), resolution)


def usual_step(times: np.ndarray) -> float:
    """From one of the times `[row]` to the next, where none is missing; NaN of a single one.

    Of times that were rounded, 0.017, 0.033, 0.050, the middle step is none: the mean of those that
    differ from it by less than `LIKE_STEPS`.
    """
    steps = np.diff(times)
    if not steps.size:
        return math.nan
    middle = float(np.quantile(steps, 0.5, method="lower"))
    return float(np.mean(steps[np.abs(steps - middle) <= LIKE_STEPS * middle]))


def _parts_of_second(whole: np.ndarray, last: np.ndarray, fps: float | None) -> float | None:
    """How many of the last field make a second: what it jumps back by where seconds go on."""
    seen = np.isfinite(last)
    whole, last = whole[seen], last[seen]
    wraps = np.flatnonzero(np.diff(whole) == 1)
    steps = np.diff(last)[np.diff(whole) == 0]
    if wraps.size and steps.size:
        step = float(np.median(steps))
        jumps = last[wraps] + step - last[wraps + 1]
        found = float(np.median(jumps))
        near = min((*COMMON_FPS, 1000), key=lambda one: abs(one - found))
        if np.abs(jumps - near).max() <= max(1.0, 0.5 * step) and last.max() < near:
            return float(near)
    if 60 <= last.max() < 100 and (fps or 0) <= 60:
        return 100.0
    if fps is None or not steps.size:
        return None
    # From row to row one frame has gone by, or as many hundredths as a frame takes.
    if np.median(steps) == 1 and last.max() < round(fps):
        return float(round(fps))
    is_hundredths = abs(fps * float(np.mean(steps)) / 100.0 - 1) < SAME_RATE
    return 100.0 if is_hundredths and last.max() < 100 else None
