"""What a long benchmark has finished: a row of JSON for each case; it goes on where it was."""

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any


def finished(path: Path) -> dict[str, dict[str, Any]]:
    """The rows by case, the last of each, without failed cases and lines that were cut off."""
    lines = path.read_text().splitlines() if path.is_file() else []
    rows = [json.loads(line) for line in lines if line.endswith("}")]
    return {row["case"]: row for row in rows if not row.get("error")}


def add(path: Path, row: Mapping[str, Any]) -> None:
    """Writes a row at the end."""
    with path.open("a") as file:
        file.write(json.dumps(row) + "\n")
