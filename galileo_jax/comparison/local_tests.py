"""Local tests: statistics of whitened residuals, cell by cell.

A cell is one object, one axis and one phase. If the model is right, its residuals there are
independent standard normal numbers. Each kind of misfit has a statistic: too large residuals
(power), a smooth deviation (energy in the slowest cosines), correlated neighbours (whiteness).
Whole tracks are tested too, because a deviation may extend over several phases.
"""

from dataclasses import dataclass

import numpy as np
from scipy.fft import dct

from galileo_jax.comparison.phases import PHASES
from galileo_jax.observation.observation import Observation

MIN_FRAMES = 5
SLOW_SHARE, MAX_SLOW = 0.25, 6  # cosines that count as slow
WHOLE = "whole"


@dataclass(frozen=True)
class Cell:
    """Where a statistic looks."""

    clip: int  # index of the clip
    object: str
    axis: str  # "x" or "y"
    phase: str  # of `PHASES`, or "whole"
    index: np.ndarray  # of its values in a clip's whitened residuals, in the order of time


def find_cells(
    clip: int, seen: Observation, measured: np.ndarray, labels: np.ndarray
) -> list[Cell]:
    """The cells of one clip with enough frames.

    `measured`, where there is a whitened residual (`is_measured`), is `[object, axis, frame]`,
    `labels` (indices into `PHASES`) `[object, frame]`.
    """
    frames = measured.shape[-1]
    found = []
    for i, name in enumerate(seen.names):
        for a, axis in enumerate(seen.axes):
            first = (i * len(seen.axes) + a) * frames
            for phase in (*PHASES, WHOLE):
                chosen = measured[i, a] & (
                    np.ones(frames, bool) if phase == WHOLE else labels[i] == PHASES.index(phase)
                )
                index = first + np.flatnonzero(chosen)
                if len(index) >= MIN_FRAMES:
                    found.append(Cell(clip, name, axis, phase, index))
    return found


def statistics(white: np.ndarray, cell: Cell, least: float, correlation: float = 0.0) -> np.ndarray:
    """Power, slowness and whiteness of one cell, each about normal if the model is right.

    `[replicate, 3]`; sums of squares as their cube roots (Wilson and Hilferty 1931).

    `white`: `[replicate, value]`, residuals of the clip. `least`: the sum of squares that noise
    alone gives there. Where there is less, neighbours that go together more than expected count
    against it: a tracker's faint memory is no physics. `correlation`: of neighbours that noise
    alone has there. Where the patterns that the likelihood allows for take up all that is smooth,
    what is left alternates.
    """
    values = white[:, cell.index]
    slow = min(MAX_SLOW, max(1, int(SLOW_SHARE * len(cell.index))))
    spectrum = np.asarray(dct(values, axis=1, norm="ortho"))[:, :slow]
    power = np.cbrt(np.mean(values**2, axis=1))
    slowness = np.cbrt(np.mean(spectrum**2, axis=1))
    neighbours = np.sum(values[:, 1:] * values[:, :-1], axis=1)
    squares = np.sum(values**2, axis=1)
    surplus = neighbours - correlation * squares
    # Residuals that are all exactly 0 (rows that stand still) follow nothing.
    whole = np.where(surplus > 0, np.maximum(squares, least), squares)
    whiteness = surplus / np.where(whole > 0, whole, 1.0)
    return np.stack([power, slowness, whiteness], axis=1)
