"""Training and validation loss, epoch by epoch."""

from collections.abc import Sequence

import numpy as np

from galileo_jax.report.figure import panel, style, to_svg


def loss_svg(losses: Sequence[tuple[float, float]]) -> str:
    """An SVG document; `losses`: `(training, validation)` of every epoch."""
    values = np.asarray(losses)
    epochs = np.arange(1, len(values) + 1)
    with style("loss"):
        figure, axes = panel("Loss", "epoch", "")
        for column, (label, colour) in enumerate(
            (("training", "#c2592f"), ("validation", "#3273b3"))
        ):
            axes.plot(epochs, values[:, column], label=label, color=colour, linewidth=1.0)
        if (values > 0).all():
            axes.set_yscale("log")
        axes.legend()
    return to_svg(figure, "loss")
