"""First and last frame of the clip beside the simulated ones, and the prediction's end."""

from collections import deque
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from galileo_jax.prediction.extrapolate import Motions, as_measured
from galileo_jax.report import gl_view
from galileo_jax.report.figure import style
from galileo_jax.report.side_view import Still, View, draw, view_of
from galileo_jax.results.run import Run
from galileo_jax.runtime.atomic_write import replacing
from galileo_jax.video import decode

if TYPE_CHECKING:
    from matplotlib.axes import Axes

COLUMN_IN = 4.8


def write_first_and_last(run: Run, motions: Motions, path: Path) -> str:
    """Writes the picture; returns how the simulated side was made: "rendered" or "drawn"."""
    from matplotlib.figure import Figure

    median = np.median(as_measured(run.problem.model, motions), axis=0)
    clip_end_s = float(run.problem.observation.times_s[-1])
    last = int(np.searchsorted(motions.times_s, clip_end_s - 1e-9))
    stills = [
        Still(median[..., 0], "simulated, first frame"),
        Still(median[..., last], f"simulated, last frame ({clip_end_s:.2f} s)"),
        Still(median[..., -1], f"predicted, {motions.times_s[-1]:.2f} s"),
    ]
    view = view_of(run.clip, run.problem.model.scene, median)
    filmed = _first_and_last_frame(run.clip.video) if run.clip.video else []
    pictures = gl_view.render(run.problem.model.scene, stills, view)
    columns = 2 if filmed else 1
    tallest = max(
        view.height_px / view.width_px, *(frame.shape[0] / frame.shape[1] for frame in filmed), 0.0
    )
    row_in = COLUMN_IN * tallest + 0.3
    with style("first_and_last"):
        figure = Figure(figsize=(COLUMN_IN * columns, row_in * len(stills)), dpi=130)
        grid = figure.subplots(len(stills), columns, squeeze=False)
        figure.subplots_adjust(0.01, 0.01, 0.99, 1 - 0.3 / (row_in * len(stills)), 0.03, 0.16)
        for row, still in enumerate(stills):
            axes = grid[row, -1]
            if pictures is None:
                _frame(axes, view, still.title)
                draw(axes, run, still, view)
            else:
                _show(axes, pictures[row], still.title)
        for row in range(len(stills) if filmed else 0):
            axes = grid[row, 0]
            if row < len(filmed):
                _show(axes, filmed[row], ("first frame", "last frame")[row])
            else:
                axes.set_visible(False)
        with replacing(path) as temporary:
            figure.savefig(temporary)
    return "drawn" if pictures is None else "rendered"


def _first_and_last_frame(video: Path) -> list[np.ndarray]:
    """The two frames, `[height, width, 3]`, RGB."""
    stream = decode.frames(video)
    first = next(stream)
    last = deque(stream, maxlen=1)
    return [frame[..., ::-1] for frame in (first, *last)]


def _show(axes: "Axes", picture: np.ndarray, title: str) -> None:
    axes.imshow(picture)
    axes.set(xticks=[], yticks=[], title=title)
    for side in axes.spines.values():
        side.set_visible(False)


def _frame(axes: "Axes", view: View, title: str) -> None:
    """Axes that show the view's part of the scene, in equal scale."""
    sides = (view.left_m, view.right_m)
    axes.set(
        xlim=sides[::-1] if view.is_mirrored else sides,
        ylim=(view.bottom_m, view.top_m),
        xticks=[], yticks=[], aspect="equal", title=title,
    )  # fmt: skip
