"""Tables as files, by their suffix."""

from pathlib import Path

from galileo_jax.runtime.atomic_write import replacing
from galileo_jax.runtime.errors import InputError
from galileo_jax.runtime.lazy import pd

TABLE_FORMATS = ("csv", "parquet")


def write_table(path: Path, table: "pd.DataFrame") -> None:
    """Writes a table to .csv or .parquet, without its index; what is NaN or None is left empty."""
    with replacing(path) as temporary:
        if path.suffix == ".csv":
            table.to_csv(temporary, index=False, lineterminator="\n")
            return
        try:
            table.to_parquet(temporary, index=False, engine="pyarrow")
        except ImportError:
            raise InputError(
                "--to parquet: needs pyarrow; pip install 'galileo-jax[parquet]', or use --to csv"
            ) from None
