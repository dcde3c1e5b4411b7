"""The places of a table in time, one panel for each axis."""

import numpy as np

from galileo_jax.clip.look import Seen
from galileo_jax.report.chart import Chart, Panel, Points, stacked
from galileo_jax.report.style import object_colour
from galileo_jax.table.track_table import TrackTable


def look_chart(seen: Seen, table: TrackTable) -> Chart:
    """Every object's places along each axis, in the table's own units."""
    clock = table.frames if table.times_s is None else table.times_s
    assert clock is not None  # a table has one of the two
    panels = []
    for i, axis in enumerate(table.axes):
        marks = tuple(
            Points(clock, np.asarray(place[i]), object_colour(k), name)
            for k, (name, place) in enumerate(zip(table.names, table.position, strict=True))
        )
        title = seen.path.name if i == 0 else ""
        xlabel = "frame" if table.times_s is None else "time, s"
        panels.append(Panel(f"{axis}, {seen.unit or 'no unit'}", marks, title, xlabel))
    return stacked("look", f"places in {seen.path.name}", panels)
