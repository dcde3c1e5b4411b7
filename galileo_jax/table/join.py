"""Several tables of one motion, an object or more in each, on one clock."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from galileo_jax.runtime.errors import InputError
from galileo_jax.table.track_table import TrackTable

SAME = 0.25
"""Of a step: times that are nearer than this are one."""


def joined(paths: Sequence[Path], tables: Sequence[TrackTable]) -> TrackTable:
    """The tables as one, with a row for each time at which any object was seen.

    Args:
      paths: named in what is said; an object is called by its file where all are called the same.
      tables: with the same axes and unit, all with times or all with frames.

    Raises:
      InputError: they have different axes, units or clocks, or no time in common.
    """
    first = tables[0]
    if len(tables) == 1:
        return first
    for path, table in zip(paths[1:], tables[1:], strict=True):
        for what, is_same in (
            ("axes", table.axes == first.axes),
            ("units of length", table.unit == first.unit),
            ("clocks (times in one, frames in the other)",
             (table.times_s is None) == (first.times_s is None)),
        ):  # fmt: skip
            if not is_same:
                raise InputError(
                    f"{path}: other {what} than {paths[0].name}; the same expected in all files of "
                    "one motion"
                )
    clocks = [table.clock for table in tables]
    step = min(float(np.median(np.diff(clock))) for clock in clocks)
    times = np.sort(np.concatenate(clocks))
    groups = np.split(times, 1 + np.flatnonzero(np.diff(times) > SAME * step))
    common = np.array([group.mean() for group in groups])
    place = np.full((sum(len(t.names) for t in tables), len(first.axes), len(common)), np.nan)
    at, shared = 0, np.zeros(len(common), int)
    for table, clock in zip(tables, clocks, strict=True):
        rows = np.abs(common[:, None] - clock).argmin(axis=0) if len(clock) else np.zeros(0, int)
        place[at : at + len(table.names), :, rows] = table.position
        shared[rows] += 1
        at += len(table.names)
    if shared.max() < len(tables):
        raise InputError(
            f"{paths[1]}: no time in common with {paths[0].name}; files of one motion on one clock "
            "expected"
        )
    names = [name for table in tables for name in table.names]
    if len(set(names)) < len(names):
        names = [
            path.stem if len(table.names) == 1 else f"{path.stem} {name}"
            for path, table in zip(paths, tables, strict=True)
            for name in table.names
        ]
    return replace(
        first,
        names=tuple(names),
        position=place,
        times_s=None if first.times_s is None else common,
        frames=None if first.times_s is not None else np.rint(common),
        resolution=tuple(max(each) for each in zip(*(t.resolution for t in tables), strict=True)),
        warnings=tuple(line for table in tables for line in table.warnings),
    )
