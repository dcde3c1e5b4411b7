"""First and last frame of the clip beside the simulated ones, and the end of the prediction."""

from pathlib import Path

import numpy as np

from galileo_jax.prediction.extrapolate import Motions, as_measured
from galileo_jax.report.side_view import draw_still, view_of
from galileo_jax.report.style import matplotlib_style
from galileo_jax.report.video_frames import first_and_last_frame
from galileo_jax.results.run import Run
from galileo_jax.runtime.atomic_write import replacing

COLUMN_IN, TITLE_IN = 4.8, 0.3


def write_first_and_last(run: Run, motions: Motions, path: Path) -> None:
    """Writes the picture as PNG: the frames of the video, where there is one, and the drawings."""
    from matplotlib.figure import Figure

    scene = run.problem.model.scene
    median = np.median(as_measured(run.problem.model, motions), axis=0)
    clip_end_s = float(run.problem.observation.times_s[-1])
    last = int(np.searchsorted(motions.times_s, clip_end_s - 1e-9))
    view = view_of(run.clip, scene, median)
    stills = {
        "simulated, first frame": 0,
        f"simulated, last frame ({clip_end_s:.2f} s)": last,
        f"predicted, {motions.times_s[-1]:.2f} s": -1,
    }
    drawn = [draw_still(run.clip, scene, view, median[..., index]) for index in stills.values()]
    columns = [list(zip(stills, drawn, strict=True))]
    if run.clip.video:
        frames = first_and_last_frame(run.clip.video)
        columns.insert(0, list(zip(("first frame", "last frame"), frames, strict=False)))
    tallest = max(
        picture.shape[0] / picture.shape[1] for column in columns for _, picture in column
    )
    row_in = COLUMN_IN * tallest + TITLE_IN
    with matplotlib_style("first_and_last"):
        figure = Figure(figsize=(COLUMN_IN * len(columns), row_in * len(stills)), dpi=130)
        grid = figure.subplots(len(stills), len(columns), squeeze=False)
        top = 1 - TITLE_IN / (row_in * len(stills))
        figure.subplots_adjust(0.01, 0.01, 0.99, top, 0.03, 0.16)
        for axes in grid.flat:
            axes.set_axis_off()
        for j, column in enumerate(columns):
            for axes, (title, picture) in zip(grid[:, j], column, strict=False):
                axes.imshow(picture)
                axes.set(title=title, xticks=[], yticks=[])
                axes.set_axis_on()
                axes.spines[:].set(visible=True, alpha=0.3)
        with replacing(path) as temporary:
            figure.savefig(temporary)
