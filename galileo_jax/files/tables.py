"""Tables as files: csv, parquet, netCDF.

A table is a mapping from column to values of the same length, text or numbers.
"""

import csv
import io
import math
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from galileo_jax.runtime.atomic_write import replacing, write_text
from galileo_jax.runtime.errors import InputError

Table = Mapping[str, Sequence[Any] | np.ndarray]


def write_csv(path: Path, table: Table) -> None:
    """One header, one row per entry; what is NaN or None is an empty cell."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(table)
    for row in zip(*(np.asarray(values).tolist() for values in table.values()), strict=True):
        writer.writerow("" if _is_absent(value) else value for value in row)
    write_text(path, text.getvalue())


def write_parquet(path: Path, table: Table) -> None:
    """Apache Parquet; NaN is null.

    Raises:
      InputError: pyarrow, an optional dependency of 150 MB, is not installed.
    """
    try:
        import pyarrow
        import pyarrow.parquet
    except ImportError:
        raise InputError(
            "--to parquet: needs pyarrow; pip install 'galileo-jax[parquet]', or use --to csv"
        ) from None
    columns = {
        name: pyarrow.array(
            [None if _is_absent(value) else value for value in np.asarray(values).tolist()]
        )
        for name, values in table.items()
    }
    with replacing(path) as temporary:
        pyarrow.parquet.write_table(pyarrow.table(columns), temporary)


TABLE_WRITERS: dict[str, Callable[[Path, Table], None]] = {
    "csv": write_csv,
    "parquet": write_parquet,
}


def _is_absent(value: Any) -> bool:
    return value is None or (isinstance(value, float) and math.isnan(value))
