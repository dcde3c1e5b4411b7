"""The measured places of a track, and those of a table that was not measured yet."""

from collections.abc import Sequence

import numpy as np

from galileo_jax.clip.look import Seen
from galileo_jax.observation.observation import Observation
from galileo_jax.report.chart import Chart, Panel, Points, stacked, time_limits
from galileo_jax.report.style import object_colour
from galileo_jax.table.track_table import TrackTable


def track_chart(observation: Observation, name: str) -> Chart:
    """Measured x and y of every object against time, m and s, with 95 % intervals, beside."""
    panels = []
    for axis, along in enumerate(observation.axes[:2]):
        marks = _places(
            observation.names,
            observation.times_s,
            observation.position_m[:, axis],
            np.sqrt(observation.covariance_m2[:, axis, axis]),
        )
        xlim = time_limits(observation.times_s)
        panels.append(Panel(f"{along}, m", marks, xlabel="time, s", xlim=xlim))
    return Chart("track", f"{name}: measured positions", tuple(panels), columns=2)


def look_chart(seen: Seen, table: TrackTable) -> Chart:
    """Every object's places along each axis, in the table's own units, axis below axis."""
    panels = []
    for i, axis in enumerate(table.axes):
        marks = _places(table.names, table.clock, [np.asarray(one[i]) for one in table.position])
        title = seen.path.name if i == 0 else ""
        xlabel = "frame" if table.is_in_frames else "time, s"
        panels.append(Panel(f"{axis}, {seen.unit or 'no unit'}", marks, title, xlabel))
    return stacked("look", f"places in {seen.path.name}", panels)


def _places(
    names: Sequence[str],
    clock: np.ndarray,
    places: Sequence[np.ndarray] | np.ndarray,
    sd: np.ndarray | None = None,
) -> tuple[Points, ...]:
    """All objects' places along one axis, `[object, frame]`."""
    return tuple(
        Points(clock, places[i], object_colour(i), name, sd=None if sd is None else sd[i])
        for i, name in enumerate(names)
    )
