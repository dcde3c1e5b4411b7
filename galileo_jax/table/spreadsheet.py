"""Spreadsheets (xlsx, xls, ods) to rows of cells, by calamine in a process of its own.

A sheet of two cells in opposite corners is a range of 17,000 million cells, at which calamine ends
the process it runs in; so that process is a child, with little memory and time.

    python -m galileo_jax.table.spreadsheet    # bytes on standard input, rows as JSON on output
"""

import io
import json
import os
import subprocess
import sys
import zipfile
from contextlib import suppress
from datetime import date, datetime, time, timedelta
from typing import Any

from galileo_jax.runtime.errors import InputError
from galileo_jax.table.numbers import Rows

MAX_BYTES, MAX_SECONDS = 700_000_000, 8.0
MAX_ROWS = 200_000
OLE = b"\xd0\xcf\x11\xe0\xa1\xb1\x1a\xe1"
WANTED = "save the sheet as csv"


def is_spreadsheet(content: bytes) -> bool:
    """Whether a file is an xlsx, ods or xls, by its content."""
    if content.startswith(OLE):
        return True
    if not content.startswith(b"PK\x03\x04"):
        return False
    try:
        with zipfile.ZipFile(io.BytesIO(content)) as archive:
            names = archive.namelist()
    except (zipfile.BadZipFile, RuntimeError, NotImplementedError, ValueError):
        return True  # cut off: `spreadsheet_rows` says so
    return any(name.startswith("xl/") or name == "content.xml" for name in names)


def spreadsheet_rows(content: bytes) -> Rows:
    """The rows that are not blank of the first sheet that has numbers, each with its number.

    Raises:
      InputError: it cannot be read within `MAX_BYTES` of memory and `MAX_SECONDS`, or is empty.
    """
    command = [sys.executable, "-m", "galileo_jax.table.spreadsheet"]
    environment = os.environ | {"PYTHONPATH": os.pathsep.join(filter(None, sys.path))}
    try:
        done = subprocess.run(
            command, input=content, capture_output=True, timeout=MAX_SECONDS, env=environment
        )
    except subprocess.TimeoutExpired:
        raise InputError(f"a spreadsheet that takes too long; {WANTED}") from None
    if done.returncode:
        raise InputError(f"not a whole spreadsheet, or far too large a one; {WANTED}")
    rows = [(int(line), [str(cell) for cell in row]) for line, row in json.loads(done.stdout)]
    if not rows:
        raise InputError("a spreadsheet without rows; time and place in columns expected")
    if len(rows) > MAX_ROWS:
        raise InputError(f"{len(rows)} rows; at most {MAX_ROWS} expected")
    return rows


def _written(value: Any) -> str:
    match value:
        case float() | int() if not isinstance(value, bool):
            return repr(int(value) if float(value).is_integer() and abs(value) < 1e15 else value)
        case datetime() | time():
            return value.isoformat()
        case date():  # calamine's word for midnight
            return datetime.combine(value, time()).isoformat()
        case timedelta():
            return repr(value.total_seconds())
    return str(value).strip()


def _main() -> None:
    from python_calamine import load_workbook

    with suppress(ImportError):  # Windows: the parent's time limit is left
        import resource

        resource.setrlimit(resource.RLIMIT_AS, (MAX_BYTES, MAX_BYTES))
    book = load_workbook(io.BytesIO(sys.stdin.buffer.read()))
    found: list[tuple[int, list[str]]] = []
    for name in book.sheet_names:
        sheet = book.get_sheet_by_name(name)
        rows = enumerate(sheet.to_python(skip_empty_area=False), 1)
        found = [(n, [_written(cell) for cell in row]) for n, row in rows]
        found = [(n, row) for n, row in found if any(row)]
        if sum(any(c[:1].isdigit() or c[:1] == "-" for c in row) for _, row in found) > 3:
            break
    json.dump(found, sys.stdout)


if __name__ == "__main__":
    _main()
