"""DeepLabCut: predictions as csv or h5, in pixels, with a likelihood for every point.

    scorer,DLC_resnet50_...,          one column per (scorer[, individual], body part, x | y |
    bodyparts,block,block,block       likelihood), rows by frame
    coords,x,y,likelihood
    0,418.48,257.23,0.9998

The h5 file is what pandas' `to_hdf` writes (key `df_with_missing`), as "table" or "fixed".
"""

import io
import pickle
from pathlib import Path
from typing import Any, ClassVar

import numpy as np

from galileo_jax.clip.track_files.cells import first_cells, parse_columns, read_cells
from galileo_jax.clip.track_files.track_table import TrackReader, TrackTable, register
from galileo_jax.runtime.errors import InputError

HDF5 = b"\x89HDF\r\n\x1a\n"
ROWS = ("scorer", "individuals", "bodyparts", "coords")
MIN_LIKELIHOOD = 0.6
"""DeepLabCut's own `pcutoff`: points less likely count as not seen."""

Column = tuple[str, ...]
"""(scorer, [individual,] body part, coordinate)."""


@register
class DeepLabCut(TrackReader):
    """Predictions of one or several animals, or objects."""

    name: ClassVar[str] = "deeplabcut"
    meaning: ClassVar[str] = "DeepLabCut csv or h5"

    @staticmethod
    def claims(head: bytes) -> bool:
        """An HDF5 file, or rows that begin with DeepLabCut's words."""
        if head.startswith(HDF5):
            return True
        return any(line[0] in ROWS for line in first_cells(head, 2))

    @staticmethod
    def read(path: Path) -> TrackTable:
        """The places where the likelihood is at least `MIN_LIKELIHOOD`."""
        with path.open("rb") as file:
            is_hdf5 = file.read(len(HDF5)) == HDF5
        frames, values = _from_hdf5(path) if is_hdf5 else _from_csv(path)
        names = list(dict.fromkeys(column[1:-1] for column in values))
        position = []
        for name in names:
            found = {column[-1]: values[column] for column in values if column[1:-1] == name}
            if missing := {"x", "y", "likelihood"} - set(found):
                raise InputError(
                    f"{path}: {' '.join(name)}: no column {', '.join(sorted(missing))}; "
                    "x, y and likelihood of every body part expected"
                )
            is_seen = found["likelihood"] >= MIN_LIKELIHOOD
            position.append(np.where(is_seen, [found["x"], found["y"]], np.nan))
        return TrackTable(
            names=tuple(" ".join(name) for name in names),
            position=np.array(position),
            frames=frames,
            unit="px",
            y_axis="down",
        )


def _from_csv(path: Path) -> tuple[np.ndarray, dict[Column, np.ndarray]]:
    rows = read_cells(path)
    header: dict[str, list[str]] = {}
    while rows and rows[0][1][0] in ROWS:
        title, *cells = rows.pop(0)[1]
        header[title] = cells
    for title in ("scorer", "bodyparts", "coords"):
        if title not in header:
            raise InputError(
                f"{path}: no row {title!r} in the header; a csv of DeepLabCut expected"
            )
    if len({len(cells) for cells in header.values()}) > 1:
        raise InputError(f"{path}: its header's rows differ in length")
    columns = list(zip(*(header[title] for title in ROWS if title in header), strict=True))
    titles = {"frame": 0} | {"/".join(column): at for at, column in enumerate(columns, 1)}
    parsed = parse_columns(path, rows, titles)
    return parsed["frame"], {column: parsed["/".join(column)] for column in columns}


def _from_hdf5(path: Path) -> tuple[np.ndarray, dict[Column, np.ndarray]]:
    import h5py

    try:
        with h5py.File(path) as file:
            frame = next((group for group in file.values() if isinstance(group, h5py.Group)), None)
            if frame is None:
                raise InputError(f"{path}: no table in it; an h5 file of DeepLabCut expected")
            if "table" in frame:
                return _appendable(frame["table"])
            return _fixed(frame)
    except InputError:
        raise
    except Exception as error:  # h5py and pickle raise whatever the bytes make them
        reason = " ".join(str(error).split())[:100]
        raise InputError(f"{path}: not an h5 file of DeepLabCut ({reason})") from None


def _appendable(table: Any) -> tuple[np.ndarray, dict[Column, np.ndarray]]:
    """In pandas' format "table": one record per frame, the columns' names pickled beside it."""
    rows = table[:]
    columns = _unpickled(bytes(table.attrs["values_block_0_kind"]))
    values = rows["values_block_0"].astype(float)
    return rows["index"].astype(float), dict(zip(columns, values.T, strict=True))


def _fixed(frame: Any) -> tuple[np.ndarray, dict[Column, np.ndarray]]:
    """In pandas' format "fixed": the columns' names as levels and the places in them."""
    count = int(frame.attrs["block0_items_nlevels"])
    levels = [
        [frame[f"block0_items_level{n}"][:][label].decode() for label in
         frame[f"block0_items_label{n}"][:]]
        for n in range(count)
    ]  # fmt: skip
    values = frame["block0_values"][:].astype(float)
    columns = zip(*levels, strict=True)
    return frame["axis1"][:].astype(float), dict(zip(columns, values.T, strict=True))


class _Plain(pickle.Unpickler):
    """Unpickles lists, tuples and text, and nothing that could run."""

    def find_class(self, module_name: str, global_name: str) -> Any:
        raise pickle.UnpicklingError(f"{module_name}.{global_name} in its column names")


def _unpickled(content: bytes) -> list[Column]:
    columns = _Plain(io.BytesIO(content)).load()
    return [tuple(str(word) for word in column) for column in columns]
