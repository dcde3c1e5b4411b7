"""The places of a table in time, one panel for each axis."""

from pathlib import Path

import numpy as np

from galileo_jax.clip.look import Seen
from galileo_jax.table.track_table import TrackTable


def write_look_figure(path: Path, seen: Seen, table: TrackTable) -> Path:
    """Writes the figure in the format of the path's suffix, and returns the path."""
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot as plt

    clock = table.frames if table.times_s is None else table.times_s
    assert clock is not None  # a table has one of the two
    figure, panels = plt.subplots(len(table.axes), 1, sharex=True, squeeze=False)
    for axis, panel in zip(range(len(table.axes)), np.ravel(panels), strict=True):
        for name, place in zip(table.names, table.position, strict=True):
            panel.plot(clock, place[axis], ".", markersize=4, label=name)
        panel.set_ylabel(f"{table.axes[axis]} ({seen.unit or 'no unit'})")
    panels[-1, 0].set_xlabel("frame" if table.times_s is None else "time (s)")
    panels[0, 0].set_title(seen.path.name)
    if len(table.names) > 1:
        panels[0, 0].legend()
    path.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(path)
    plt.close(figure)
    return path
