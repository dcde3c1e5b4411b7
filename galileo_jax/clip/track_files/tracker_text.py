"""Tracker's text export (File | Export | Data): names above, then t, x, y, then numbers.

mass_A                      or        #multi:
t,x,y                                 ,mass A,,,mass B,,
0.0,1.2E-2,-3.0E-3                    t,x,y,r,x,y,r
"""

from pathlib import Path
from typing import ClassVar

import numpy as np

from galileo_jax.clip.track_files.cells import first_cells, parse_columns, read_cells
from galileo_jax.clip.track_files.titles import title_of
from galileo_jax.clip.track_files.track_table import TrackReader, TrackTable, register
from galileo_jax.runtime.errors import InputError

MULTI = "#multi:"


@register
class TrackerText(TrackReader):
    """Tracker's exports: comma, tab or semicolon, decimal points or commas."""

    name: ClassVar[str] = "tracker_text"
    meaning: ClassVar[str] = "Tracker's data export"

    @staticmethod
    def claims(head: bytes) -> bool:
        """The names' row, then one that begins with t and has a column x."""
        lines = first_cells(head)
        if lines and lines[0][0] == MULTI:
            return True
        if len(lines) < 2 or sum(map(bool, lines[0])) != 1:
            return False
        symbols = [title_of(cell).symbol for cell in lines[1]]
        return symbols[0] == "t" and bool({"x", "y"} & set(symbols))

    @staticmethod
    def read(path: Path) -> TrackTable:
        """The columns t, x and y; others (v_x, r, pixelx, ...) are left out."""
        rows = read_cells(path)
        if rows[0][1][0].lower() == MULTI:
            rows = rows[1:]
        if len(rows) < 2:
            raise InputError(f"{path}: cut off; a row of names, a row t, x, y and numbers expected")
        (_, above), (line, below), *rest = rows
        titles = [title_of(cell) for cell in below]
        if not titles or titles[0].symbol != "t":
            raise InputError(f"{path}: line {line}: {below[0][:20]!r} where the column t should be")
        names = [cell for cell in above if cell]
        columns, index = {"t": 0}, -1
        for at, title in enumerate(titles[1:], 1):
            # A name stands above the first column of its object, or alone at the start.
            is_named = at < len(above) and bool(above[at])
            if is_named or (at == 1 and index < 0):
                index += 1
            if title.symbol in ("x", "y") and index < len(names):
                columns.setdefault(f"{names[index]}: {title.symbol}", at)
        for name in names:
            for symbol in ("x", "y"):
                if f"{name}: {symbol}" not in columns:
                    raise InputError(
                        f"{path}: line {line}: no column {symbol} of {name[:40]!r}; "
                        "tick t, x and y in Tracker's table before exporting"
                    )
        parsed = parse_columns(path, rest, columns)
        position = [[parsed[f"{name}: x"], parsed[f"{name}: y"]] for name in names]
        units = {t.unit for t in titles if t.symbol in ("x", "y") and t.unit}
        return TrackTable(
            names=tuple(name.replace("_", " ") for name in names),
            position=np.array(position),
            times_s=parsed["t"],
            unit=units.pop() if len(units) == 1 else None,
            y_axis="up",  # of Tracker's world coordinates
        )
