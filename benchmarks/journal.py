"""What a long benchmark has finished: a row of JSON for each case; it goes on where it was."""

import contextlib
import json
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any


class Journal:
    """Rows by case, in a file if there is to be one."""

    def __init__(self, path: Path | None):
        self.path = path
        self.rows = {} if path is None else finished(path)

    def row(self, case: str, make: Callable[[], Mapping[str, Any]]) -> dict[str, Any]:
        """The row of a case, which is made and added unless it is there."""
        if case not in self.rows:
            self.rows[case] = {"case": case, **make()}
            if self.path is not None:
                self.path.parent.mkdir(parents=True, exist_ok=True)
                with self.path.open("a", encoding="utf-8") as file:
                    file.write("\n" + json.dumps(self.rows[case]))
        return self.rows[case]

    def tried(self, case: str, make: Callable[[], Mapping[str, Any]]) -> dict[str, Any]:
        """As `row`; whatever `make` raises does not end hours of work, but is the row's `error`."""
        return self.row(case, lambda: _tried(make))


def finished(path: Path) -> dict[str, dict[str, Any]]:
    """The rows by case, the last of each, without failed cases and lines that were cut off."""
    lines = path.read_text(encoding="utf-8").splitlines() if path.is_file() else []
    rows = []
    for line in lines:
        with contextlib.suppress(json.JSONDecodeError):
            rows.append(json.loads(line))
    return {row["case"]: row for row in rows if not row.get("error")}


def _tried(make: Callable[[], Mapping[str, Any]]) -> dict[str, Any]:
    try:
        return {**make(), "error": None}
    except Exception as error:
        return {"error": f"{type(error).__name__}: {error}"}
