"""A track and what its yaml declares of it; its table, of one file or several, objects in order."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from galileo_jax.clip.scenarios import SCENARIOS, Scenario
from galileo_jax.clip.schema import ClipFile
from galileo_jax.runtime.errors import InputError
from galileo_jax.table.read import read_table
from galileo_jax.table.track_table import TrackTable

SAME = 0.25  # of a step: times of two files that are nearer than this are one


@dataclass(frozen=True)
class DeclaredTrack:
    """A track file, and what is declared of it."""

    yaml_path: Path  # named where a key is missing
    path: Path  # the track
    file: ClipFile  # the yaml's keys
    fps: float | None  # declared frames per second; None = not declared

    @property
    def scenario(self) -> Scenario:
        """The kind of motion."""
        return SCENARIOS[self.file.scenario]

    @property
    def names(self) -> tuple[str, ...]:
        """Of the objects."""
        return tuple(item.name for item in self.file.objects)

    def wrong(self, problem: str) -> InputError:
        """What is wrong with the track."""
        return InputError(f"{self.path}: {problem}")

    def wrong_key(self, problem: str) -> InputError:
        """What is wrong with a key of the yaml."""
        return InputError(f"{self.yaml_path}: {problem}")


def declared_table(of: DeclaredTrack) -> tuple[TrackTable, tuple[str, ...]]:
    """The motion that a yaml declares, and doubts about which object is which.

    Raises:
      InputError: a file cannot be read, several motions are in it, or other objects.
    """
    beside = (of.path.parent / item.track_file for item in of.file.objects if item.track_file)
    paths = [of.path, *(path for path in beside if path != of.path)]
    tables = [
        _one_motion(replace(of, path=path), read_table(path, of.fps, len(of.names)))
        for path in paths
    ]
    return _in_declared_order(of, _joined(paths, tables))


def _one_motion(of: DeclaredTrack, table: TrackTable) -> TrackTable:
    count, trial = len(table.starts), of.file.trial
    if trial is None and count > 1:
        rows = ", ".join(str(start + 1) for start in table.starts)
        raise of.wrong_key(
            f"trial: missing; {of.path.name} has {count} motions, which begin in rows "
            f"{rows}; write trial: 1 to {count}, a yaml for each, and give all to one command"
        )
    if trial is not None and trial > count:
        raise of.wrong_key(f"trial: {trial}, but {of.path.name} has {count}; 1 to {count} expected")
    motion = table.motion(trial or 1)
    if count == 1:
        return motion
    said = f"{of.path}: motion {trial} of {count} (`trial` tells which)"
    return replace(motion, warnings=(*motion.warnings, said))


def _joined(paths: Sequence[Path], tables: Sequence[TrackTable]) -> TrackTable:
    """Tables of one motion as one, with a row for each time at which any object was seen."""
    first = tables[0]
    if len(tables) == 1:
        return first
    clock = "clocks (times in one, frames in the other)"
    for path, table in zip(paths[1:], tables[1:], strict=True):
        same = {"axes": table.axes == first.axes, "units of length": table.unit == first.unit,
                clock: table.is_in_frames == first.is_in_frames}  # fmt: skip
        for what in (what for what, is_same in same.items() if not is_same):
            raise InputError(
                f"{path}: other {what} than {paths[0].name}; the same expected in all files of "
                "one motion"
            )
    clocks = [table.clock for table in tables]
    step = min(float(np.median(np.diff(clock))) for clock in clocks)
    times = np.sort(np.concatenate(clocks))
    groups = np.split(times, 1 + np.flatnonzero(np.diff(times) > SAME * step))
    common = np.array([group.mean() for group in groups])
    places, shared = [], np.zeros(len(common), int)
    for table, clock in zip(tables, clocks, strict=True):
        rows = np.abs(common[:, None] - clock).argmin(axis=0) if len(clock) else np.zeros(0, int)
        place = np.full((*table.position.shape[:2], len(common)), np.nan)
        place[:, :, rows] = table.position
        places.append(place)
        shared[rows] += 1
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
        position=np.concatenate(places),
        clock=np.rint(common) if first.is_in_frames else common,
        resolution=tuple(max(each) for each in zip(*(t.resolution for t in tables), strict=True)),
        warnings=tuple(line for table in tables for line in table.warnings),
    )


def _in_declared_order(of: DeclaredTrack, table: TrackTable) -> tuple[TrackTable, tuple[str, ...]]:
    """The table with the declared objects alone, in their order, and doubts about who is who.

    An object is found by its `track_name`, else by its own name ('mass A' is mass_A); names
    that say nothing are assigned in this order, where there are as many of them as objects.
    """
    by_name = {_plain(name): index for index, name in enumerate(table.names)}
    wanted = [item.track_name or item.name for item in of.file.objects]
    order = [by_name[_plain(name)] for name in wanted if _plain(name) in by_name]
    seen = np.isfinite(table.position).all(axis=1).sum(axis=-1)
    has = ", ".join(f"{name} ({rows} rows)" for name, rows in zip(table.names, seen, strict=True))
    for item in of.file.objects:
        if item.track_name is not None and _plain(item.track_name) not in by_name:
            raise of.wrong_key(
                f"objects ({item.name}): track_name: {item.track_name!r} is not in "
                f"{of.path.name}; it has {has}"
            )
    said: tuple[str, ...] = ()
    if len(order) < len(wanted):
        if len(wanted) != len(table.names) or order:
            raise of.wrong_key(
                f"objects: {', '.join(wanted)} declared, but {of.path.name} has {has}; write "
                f"which is which, such as track_name: {table.names[0]}"
            )
        order = list(range(len(wanted)))
        pairs = zip(wanted, table.names, strict=True)
        taken = [f"{theirs!r} as {ours}" for ours, theirs in pairs if theirs != ours]
        if len(taken) > 1:
            said = (f"{of.path}: {', '.join(taken)}: assigned in this order",)
    names = tuple(table.names[index] for index in order)
    return replace(table, names=names, position=table.position[order]), said


def _plain(name: str) -> str:
    return "".join(name.replace("_", " ").split()).casefold()
