"""Tables of pandas in HDF5, as DeepLabCut writes them: pixels, with a likelihood of every point.

One column per (scorer[, individual], body part, x | y | likelihood), rows by frame; what `to_hdf`
writes (key `df_with_missing`), as "table" or "fixed".
"""

import io
import pickle
from pathlib import Path
from typing import Any

import numpy as np

from galileo_jax.runtime.errors import InputError
from galileo_jax.table.track_table import MIN_LIKELIHOOD, TrackTable

HDF5 = b"\x89HDF\r\n\x1a\n"
Column = tuple[str, ...]
"""(scorer, [individual,] body part, coordinate)."""


def is_hdf5(content: bytes) -> bool:
    """Whether a file is HDF5."""
    return content.startswith(HDF5)


def read_h5(path: Path) -> TrackTable:
    """The places where the likelihood is at least `MIN_LIKELIHOOD`.

    Raises:
      InputError: it is not what pandas writes, or a column is missing.
    """
    frames, values = _from_hdf5(path)
    parts: dict[Column, dict[str, np.ndarray]] = {}
    for column, numbers in values.items():
        parts.setdefault(column[1:-1], {})[column[-1]] = numbers
    position = []
    for name, found in parts.items():
        if missing := {"x", "y", "likelihood"} - set(found):
            raise InputError(
                f"{' '.join(name)}: no column {', '.join(sorted(missing))}; "
                "x, y and likelihood of every body part expected"
            )
        is_seen = found["likelihood"] >= MIN_LIKELIHOOD
        position.append(np.where(is_seen, [found["x"], found["y"]], np.nan))
    return TrackTable(
        names=tuple(" ".join(name) for name in parts),
        position=np.array(position),
        clock=frames,
        unit="px",
        y_axis="down",
    )


def _from_hdf5(path: Path) -> tuple[np.ndarray, dict[Column, np.ndarray]]:
    import h5py

    try:
        with h5py.File(path) as file:
            frame = next((group for group in file.values() if isinstance(group, h5py.Group)), None)
            if frame is None:
                raise InputError("no table in it; an h5 file of DeepLabCut expected")
            if "table" in frame:
                return _appendable(frame["table"])
            return _fixed(frame)
    except InputError:
        raise
    except Exception as error:  # h5py and pickle raise whatever the bytes make them
        reason = " ".join(str(error).split())[:100]
        raise InputError(f"not an h5 file of DeepLabCut ({reason})") from None


def _appendable(table: Any) -> tuple[np.ndarray, dict[Column, np.ndarray]]:
    """In pandas' format "table": one record per frame, the columns' names pickled beside it."""
    rows = table[:]
    names = _Plain(io.BytesIO(bytes(table.attrs["values_block_0_kind"]))).load()
    columns = (tuple(str(word) for word in name) for name in names)
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
