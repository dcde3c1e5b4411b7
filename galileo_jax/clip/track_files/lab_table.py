"""Tables with titles: Logger Pro's csv, PhysTrack's columns, a spreadsheet with t, x and y.

    "VideoAnalysis: Time (s)","VideoAnalysis: X (m)","VideoAnalysis: Y (m)", ...
    t,x,y

Logger Pro numbers or names further points: 'X 2 (m)', 'X Wrist (m)'.
"""

from pathlib import Path
from typing import ClassVar

import numpy as np

from galileo_jax.clip.track_files.cells import first_cells, parse_columns, read_cells
from galileo_jax.clip.track_files.titles import TIME_UNITS, Title, title_of
from galileo_jax.clip.track_files.track_table import TrackReader, TrackTable, register
from galileo_jax.runtime.errors import InputError


@register
class LabTable(TrackReader):
    """One row of titles, then numbers."""

    name: ClassVar[str] = "lab_table"
    meaning: ClassVar[str] = "Logger Pro csv or any table with columns t, x and y"

    @staticmethod
    def claims(head: bytes) -> bool:
        """The first row has a time or a frame, and an x or y."""
        lines = first_cells(head, 1)
        symbols = {title_of(cell).symbol for line in lines for cell in line}
        return bool({"t", "frame"} & symbols) and bool({"x", "y"} & symbols)

    @staticmethod
    def read(path: Path) -> TrackTable:
        """The columns of time and places; others are left out."""
        (line, header), *rest = read_cells(path)
        titles = [title_of(cell) for cell in header]
        clock = next((t for t in titles if t.symbol == "t"), None) or Title("frame", "", None)
        symbols = [t.symbol for t in titles]
        if clock.symbol not in symbols:
            raise InputError(f"{path}: line {line}: no column t or frame")
        columns = {clock.symbol: symbols.index(clock.symbol)}
        names = list(dict.fromkeys(t.name for t in titles if t.symbol in ("x", "y")))
        for name in names:
            for symbol in ("x", "y"):
                at = [i for i, t in enumerate(titles) if (t.symbol, t.name) == (symbol, name)]
                if not at:
                    of = f" of {name!r}" if name else ""
                    raise InputError(f"{path}: line {line}: no column {symbol}{of}")
                if len(at) > 1:
                    raise InputError(f"{path}: line {line}: column {header[at[0]]!r}: given twice")
                columns[f"{name}: {symbol}"] = at[0]
        parsed = parse_columns(path, rest, columns)
        units = {t.unit for t in titles if t.symbol in ("x", "y")}
        if len(units) > 1:
            raise InputError(
                f"{path}: line {line}: the columns x and y are in different units: "
                f"{', '.join(sorted(unit or 'none' for unit in units))}"
            )
        unit = units.pop()
        is_timed = clock.symbol == "t"
        return TrackTable(
            names=tuple(name or "object1" for name in names),
            position=np.array([[parsed[f"{n}: x"], parsed[f"{n}: y"]] for n in names]),
            times_s=parsed["t"] * TIME_UNITS.get(clock.unit or "s", 1.0) if is_timed else None,
            frames=None if is_timed else parsed["frame"],
            unit=unit,
            # Logger Pro names the data set before a colon, and its axes point up.
            y_axis="up" if any(":" in cell for cell in header) else None,
        )
