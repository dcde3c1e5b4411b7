"""Rows with the same time: one that is written twice, and two places at one time."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np


def without_repeats(
    path: Path, times: np.ndarray, places: np.ndarray, lines: Sequence[int]
) -> tuple[np.ndarray, np.ndarray, list[str]]:
    """Times `[row]` and places `[object, axis, row]` with each time once, and what was done.

    Rows that follow each other at one time count once where they are equal, else as their mean.
    """
    if times.size < 2 or not (np.diff(times) == 0).any():
        return times, places, []
    group = np.concatenate([[0], np.cumsum(np.diff(times) != 0)])
    count = int(group[-1]) + 1
    starts = np.flatnonzero(np.concatenate([[True], np.diff(times) != 0]))
    seen = np.isfinite(places)
    total = np.add.reduceat(np.where(seen, places, 0.0), starts, axis=-1)
    number = np.add.reduceat(seen, starts, axis=-1)
    mean = np.where(number > 0, total / np.maximum(number, 1), np.nan)
    differs = seen & (places != mean[..., group])
    repeats = np.bincount(group, minlength=count) > 1
    num_mixed = int(np.unique(group[differs.any(axis=(0, 1))]).size)
    first = lines[int(starts[int(repeats.argmax())])]
    how = (
        f"{num_mixed} of them with other places, of which the mean is used"
        if num_mixed
        else "with the same places, which count once"
    )
    said = f"{path}: line {first}: {int(repeats.sum())} times stand in several rows, {how}"
    return times[starts], mean, [said]
