"""Times as people and programs write them: seconds, m:s, h:m:s:frames, dates, to seconds.

Dates and clocks are counted from the first row on before anything is rounded.
"""

import re
from datetime import UTC, datetime
from pathlib import Path

import numpy as np

from galileo_jax.runtime.errors import InputError
from galileo_jax.table.numbers import Numbers, Rows, is_nothing

CLOCK = re.compile(r"(?:(\d{1,4}):)?(\d{1,4}):(\d{1,2})(?:[.,](\d+))?")
FIELDS = re.compile(r"(\d{1,3}):(\d{1,2}):(\d{1,2})[:;](\d{1,3})")
DATE = re.compile(r"\d{4}-\d{2}-\d{2}[T ]\d{2}:\d{2}(:\d{2}([.,]\d+)?)?\s?(Z|[+-]\d{2}:?\d{2})?")
COMMON_FPS = (24, 25, 30, 48, 50, 60, 100, 120, 240)
UNIX_MS = (1e11, 1e14)
"""Milliseconds since 1970 from 1973 on; no motion lasts as many."""


def is_time(cell: str) -> bool:
    """Whether a cell is a date or a clock, not a plain number."""
    return ":" in cell and bool(
        CLOCK.fullmatch(cell) or FIELDS.fullmatch(cell) or DATE.fullmatch(cell)
    )


def clock_times(path: Path, rows: Rows, title: str, at: int, fps: float | None) -> Numbers | None:
    """Seconds from the first row on of a column of dates or clocks; None: it has none.

    Raises:
      InputError: a cell is of another form than the first; or whether the last of four fields
        counts frames or hundredths cannot be told.
    """
    there = (row[at] for _, row in rows if at < len(row))
    first = next((cell for cell in there if not is_nothing(cell)), "")
    form = next((one for one in (FIELDS, CLOCK, DATE) if one.fullmatch(first)), None)
    if form is None or not is_time(first):
        return None
    cells = [(line, row[at] if at < len(row) else "") for line, row in rows]
    parsed = []
    for line, cell in cells:
        match = form.fullmatch(cell)
        if match is None and not is_nothing(cell):
            raise InputError(
                f"{path}: line {line}: {title}: {cell[:40]!r} is not a time such as {first[:40]!r}"
            )
        parsed.append(match)
    try:
        if form is DATE:
            return _dates(parsed)
    except ValueError as error:
        raise InputError(
            f"{path}: {title}: {error}; a date such as {first[:40]!r} expected"
        ) from None
    if form is CLOCK:
        values = [np.nan if m is None else _seconds(m[1], m[2], m[3]) + float(f"0.{m[4] or 0}")
                  for m in parsed]  # fmt: skip
        digits = max((len(m[4] or "") for m in parsed if m), default=0)
        return _from_first(np.array(values), 10.0**-digits)
    whole = np.array([np.nan if m is None else _seconds(m[1], m[2], m[3]) for m in parsed])
    last = np.array([np.nan if m is None else float(m[4]) for m in parsed])
    parts = _parts_of_second(whole, last, fps)
    if parts is None:
        raise InputError(
            f"{path}: {title}: {first!r}: whether its last field counts frames or hundredths of a "
            "second is not told; write seconds, such as 0.125"
        )
    return _from_first(whole + last / parts, 1.0 / parts)


def _seconds(hours: str | None, minutes: str, seconds: str) -> float:
    return 3600.0 * int(hours or 0) + 60.0 * int(minutes) + int(seconds)


def _dates(parsed: list[re.Match[str] | None]) -> Numbers:
    moments = [
        None if m is None else datetime.fromisoformat(m[0].replace(",", ".")) for m in parsed
    ]
    moments = [m if m is None or m.tzinfo else m.replace(tzinfo=UTC) for m in moments]
    start = next(m for m in moments if m is not None)
    values = [np.nan if m is None else (m - start).total_seconds() for m in moments]
    digits = max(len((m[2] or ".")[1:]) for m in parsed if m)
    return Numbers(np.array(values), 10.0**-digits)


def _from_first(values: np.ndarray, resolution: float) -> Numbers:
    seen = values[np.isfinite(values)]
    return Numbers(values - (seen[0] if seen.size else 0.0), resolution)


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
    if last.size and 60 <= last.max() < 100 and (fps or 0) <= 60:
        return 100.0
    if fps is not None and last.size and last.max() < round(fps):
        return float(round(fps)) if np.median(steps) == 1 else None
    return None
