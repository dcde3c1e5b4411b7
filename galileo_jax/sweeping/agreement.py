"""What the groups of a class agree on, and a remark on each that stands apart.

The class is the first result of each clip (of each group of trials), in the order of the config.
"""

import math
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np

from galileo_jax.clip.file_kinds import is_yaml
from galileo_jax.clip.yaml_file import read_mapping
from galileo_jax.comparison.consensus import FEWEST, consensus
from galileo_jax.report.class_chart import Agreement
from galileo_jax.results.shown import number
from galileo_jax.runtime.errors import InputError
from galileo_jax.sweeping.cell import Cell
from galileo_jax.sweeping.clip_rows import natural
from galileo_jax.sweeping.summary import Row

OWN = {"video", "track", "trial", "name", "track_name", "track_file", "point_px"}
"""Keys of a yaml in which clips of one experiment differ."""


def agreements(rows: Sequence[Row], names: Sequence[str]) -> tuple[Agreement, ...]:
    """Of each quantity that most groups determined what they find together.

    Where truths are known to differ there is no such thing.
    """
    done = [i for i in _first(rows) if rows[i]["status"] == "done"]
    suffix = "_identified"
    columns = dict.fromkeys(key for i in done for key in rows[i] if key.endswith(suffix))
    found = (_agreement(name.removesuffix(suffix), rows, names, done) for name in columns)
    return tuple(one for one in found if one is not None)


def with_remarks(
    rows: Sequence[Row], names: Sequence[str], cells: Sequence[Cell], found: Sequence[Agreement]
) -> list[Row]:
    """The rows with what is `outside` and why a group stands apart, as far as that is known."""
    first = _first(rows)
    declared = {i: _declared(cells[i]) for i in first}
    verdicts = Counter(rows[i]["verdict"] for i in first)
    usual, most = next(iter(verdicts.most_common(1)), (None, 0))
    usual = usual if 2 * most > len(first) > 1 else None
    told = list(rows)
    for i in first:
        row = rows[i]
        outside = {one.quantity: text for one in found if (text := _outside(one, names[i]))}
        reasons = [*outside.values(), row["remark"], _of_verdict(row, usual)]
        if any(reasons) or row["status"] == "failed":
            reasons += _other_declared(declared[i], [declared[j] for j in first if j != i])
        said = "; ".join(filter(None, reasons)) or None
        told[i] = row | {"outside": " ".join(outside) or None, "remark": said}
    return told


def _first(rows: Sequence[Row]) -> list[int]:
    """The row of each group: the first that is done, else the first."""
    chosen: dict[str, int] = {}
    for i in sorted(range(len(rows)), key=lambda i: rows[i]["status"] != "done"):
        chosen.setdefault(rows[i]["clips"], i)
    return sorted(chosen.values())


def _agreement(
    name: str, rows: Sequence[Row], names: Sequence[str], done: Sequence[int]
) -> Agreement | None:
    known = [i for i in done if rows[i].get(f"{name}_identified") and _sd(rows[i], name) > 0]
    truths = {rows[i].get(f"{name}_true") for i in done} - {None}
    if len(known) < FEWEST or 2 * len(known) <= len(done) or len(truths) > 1:
        return None
    known.sort(key=lambda i: natural(names[i]))

    def column(key: str) -> np.ndarray:
        return np.array([rows[i][f"{name}{key}"] for i in known], float)

    return Agreement(
        name,
        rows[known[0]][f"{name}_unit"],
        tuple(names[i] for i in known),
        column(""),
        column("_q025"),
        column("_q975"),
        consensus(column(""), column("_sd")),
        len(done) - len(known),
    )


def _sd(row: Row, name: str) -> float:
    """The standard deviation; 0 of none."""
    sd = row.get(f"{name}_sd")
    return sd if sd is not None and math.isfinite(sd) else 0.0


def _outside(one: Agreement, group: str) -> str:
    """That a group's value lies outside; empty where it does not."""
    for i in np.flatnonzero(one.found.is_outside):
        if one.groups[i] == group:
            others = one.found.others[i]
            sd = (one.values[i] - others) / one.found.t[i]  # of the difference
            value = number(one.values[i], sd)
            return f"{one.quantity} is {value} where the others find {number(others, sd)}"
    return ""


def _of_verdict(row: Row, usual: str | None) -> str:
    """What is missing here and not with most groups; empty where nothing is to be said."""
    if row["verdict"] == "unknown":
        return "the model does not describe it"
    if None in (row["verdict"], usual) or row["verdict"] == usual:
        return ""
    return f"effect: {row['effect']}, where most have {usual}"


def _other_declared(own: Mapping[str, str], others: Sequence[Mapping[str, str]]) -> Iterator[str]:
    """What a yaml declares otherwise than those of more than half of the others do."""
    for key, value in own.items():
        count = Counter(other[key] for other in others if key in other)
        text, most = next(iter(count.most_common(1)), ("", 0))
        if 2 * most > len(others) and text != value:
            yield f"it declares {key} {value} where the others have {text}"


def _declared(cell: Cell) -> dict[str, str]:
    """What the yaml of a cell's first clip says that others could say, too; keys with dots."""
    for path in cell.clips[0].paths:
        if is_yaml(path):
            try:
                return dict(_flat(read_mapping(path)))
            except InputError:  # is said where the clip is loaded
                return {}
    return {}


def _flat(value: Any, path: str = "") -> Iterator[tuple[str, str]]:
    """Each value as text under its keys: 20 and 20.0 are the same."""
    if isinstance(value, Mapping):
        for key, item in value.items():
            if key not in OWN:
                yield from _flat(item, f"{path}.{key}" if path else str(key))
    elif isinstance(value, list) and any(isinstance(item, Mapping) for item in value):
        for i, item in enumerate(value):
            yield from _flat(item, f"{path}[{i}]")
    else:
        yield path, _text(value)


def _text(value: Any) -> str:
    if isinstance(value, list):
        return f"[{', '.join(map(_text, value))}]"
    is_number = isinstance(value, int | float) and not isinstance(value, bool)
    return f"{value:g}" if is_number else str(value)
