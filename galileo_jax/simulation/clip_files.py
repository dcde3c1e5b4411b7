"""A synthetic clip's files: the video or track, its yaml, its truth; all of them or none."""

import tempfile
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from galileo_jax.clip.load import check_clip
from galileo_jax.clip.yaml_file import yaml_text
from galileo_jax.runtime.atomic_write import write_json, write_text

YAML_SUFFIX, TRUTH_SUFFIX = ".yaml", ".truth.json"

WriteClip = Callable[[Path], None]
"""Writes the clip's video or track to this path, and yaml and truth beside it."""


def write_yaml_and_truth(out: Path, content: Mapping[str, Any], record: Mapping[str, Any]) -> None:
    """Writes what is declared about the clip `out`, which is there already, and what is true.

    Raises:
      InputError: the clip would not load.
    """
    check_clip(out.with_suffix(YAML_SUFFIX), content)
    write_json(out.with_suffix(TRUTH_SUFFIX), record)
    write_text(out.with_suffix(YAML_SUFFIX), yaml_text(content))


@contextmanager
def all_or_nothing(folder: Path) -> Iterator[Path]:
    """Yields an empty folder whose files are moved to `folder` on success only."""
    folder.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory(prefix=".simulate.", dir=folder) as temporary:
        yield Path(temporary)
        for path in Path(temporary).iterdir():
            path.replace(folder / path.name)
