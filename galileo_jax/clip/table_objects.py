"""The table of a clip: its files, the motion that is meant, and its objects in the yaml's order."""

from dataclasses import replace
from pathlib import Path

from galileo_jax.clip.schema import ClipFile
from galileo_jax.runtime.errors import InputError
from galileo_jax.table.join import joined
from galileo_jax.table.read import read_table
from galileo_jax.table.track_table import TrackTable


def declared_table(
    yaml_path: Path, path: Path, file: ClipFile, fps: float | None
) -> tuple[TrackTable, tuple[str, ...]]:
    """The motion that a yaml declares, and doubts about which object is which.

    Raises:
      InputError: a file cannot be read, several motions are in it, or other objects.
    """
    more = [item.track_file for item in file.objects if item.track_file is not None]
    paths = [path, *(found for name in more if (found := path.parent / name) != path)]
    tables = [_one_motion(yaml_path, each, file, read_table(each, fps)) for each in paths]
    return _in_declared_order(yaml_path, path, file, joined(paths, tables))


def _one_motion(yaml_path: Path, path: Path, file: ClipFile, table: TrackTable) -> TrackTable:
    count = len(table.starts)
    if file.trial is None and count > 1:
        rows = ", ".join(str(start + 1) for start in table.starts)
        raise InputError(
            f"{yaml_path}: trial: missing; {path.name} has {count} motions, which begin in rows "
            f"{rows}; write trial: 1 to {count}, a yaml for each, and give all to one command"
        )
    if file.trial is not None and file.trial > count:
        raise InputError(
            f"{yaml_path}: trial: {file.trial}, but {path.name} has {count}; 1 to {count} expected"
        )
    return table.motion(file.trial or 1)


def _in_declared_order(
    yaml_path: Path, path: Path, file: ClipFile, table: TrackTable
) -> tuple[TrackTable, tuple[str, ...]]:
    """The table with the declared objects alone, in their order, and doubts about who is who.

    An object is found by its `track_name`, else by its own name ('mass A' is mass_A); names
    that say nothing are assigned in this order, where there are as many of them as objects.
    """
    by_name = {_plain(name): index for index, name in enumerate(table.names)}
    wanted = [item.track_name or item.name for item in file.objects]
    order = [by_name.get(_plain(name)) for name in wanted]
    warnings = ()
    for item, index in zip(file.objects, order, strict=True):
        if item.track_name is not None and index is None:
            raise InputError(
                f"{yaml_path}: objects ({item.name}): track_name: {item.track_name!r} is not in "
                f"{path.name}; it has {', '.join(table.names)}"
            )
    if None in order:
        if len(wanted) != len(table.names) or any(index is not None for index in order):
            raise InputError(
                f"{yaml_path}: objects: {', '.join(wanted)} declared, but {path.name} has "
                f"{', '.join(table.names)}; write which is which, such as "
                f"track_name: {table.names[0]}"
            )
        order = list(range(len(wanted)))
        pairs = zip(wanted, table.names, strict=True)
        taken = [f"{theirs!r} as {ours}" for ours, theirs in pairs if theirs != ours]
        warnings = (
            (f"{path}: {', '.join(taken)}: assigned in this order",) if len(taken) > 1 else ()
        )
    chosen = [index for index in order if index is not None]
    names = tuple(table.names[index] for index in chosen)
    return replace(table, names=names, position=table.position[chosen]), warnings


def _plain(name: str) -> str:
    return "".join(name.replace("_", " ").split()).casefold()
