"""The loss of a training, epoch by epoch."""

from collections.abc import Sequence

import numpy as np

from galileo_jax.report.chart import Chart, Line, Panel


def loss_chart(losses: Sequence[tuple[float, float]]) -> Chart:
    """`losses`: `(training, validation)` of every epoch."""
    values = np.asarray(losses)
    epochs = np.arange(1, len(values) + 1)
    lines = tuple(
        Line(epochs, values[:, i], colour, name, width_px=1.4)
        for i, (name, colour) in enumerate((("training", "object1"), ("validation", "object2")))
    )
    panel = Panel("loss", lines, xlabel="epoch", is_log_y=bool((values > 0).all()))
    return Chart("loss", "training and validation loss against the epoch", (panel,))
