"""Kinds of files, by their names and by how they begin: films, tables, declarations."""

from pathlib import Path

YAML_SUFFIXES = (".yaml", ".yml")
FILM_SUFFIXES = (
    *(".mp4", ".mov", ".m4v", ".avi", ".mkv", ".webm", ".mpg", ".mpeg", ".mts", ".wmv", ".3gp"),
)
TRACK_SUFFIXES = (
    *(".csv", ".txt", ".tsv", ".dat", ".lvm", ".trk", ".trz", ".h5", ".hdf5"),
    *(".xlsx", ".xls", ".ods", ".mat"),
)
"""Of tables; others are known by what is in them when they are named, not in a folder."""

HEAD_BYTES = 4096
WIDE_LETTERS = (b"\xff\xfe", b"\xfe\xff")  # of UTF-16, whose letters have bytes of zero


def is_yaml(path: Path) -> bool:
    """Whether a file declares a clip."""
    return path.suffix.lower() in YAML_SUFFIXES


def is_film(path: Path) -> bool:
    """Whether a file is called as films are."""
    return path.suffix.lower() in FILM_SUFFIXES


def is_track(path: Path) -> bool:
    """Whether a file given as CLIP is a table: called as tables are, or text of another name."""
    if path.suffix.lower() in TRACK_SUFFIXES:
        return True
    return not is_yaml(path) and not is_film(path) and path.is_file() and _is_text(path)


def _is_text(path: Path) -> bool:
    """Whether a file begins as a text does: in a film's first bytes there are zeros."""
    try:
        with path.open("rb") as file:
            head = file.read(HEAD_BYTES)
    except OSError:
        return False
    return bool(head) and (head.startswith(WIDE_LETTERS) or b"\0" not in head)
