"""The files of a clip: found, told apart by their content, and carried to another machine."""

import hashlib
import os
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

from galileo_jax.clip.load import find_yaml
from galileo_jax.clip.yaml_file import read_mapping
from galileo_jax.errors import InputError


@dataclass(frozen=True)
class ClipFiles:
    """A clip as it lies on disk.

    Attributes:
      path: as the clip was named: its video, its yaml, or its csv track.
      paths: all its files, as far as they are there.
      digest: of the files' content.
    """

    path: Path
    paths: tuple[Path, ...]
    digest: str

    @classmethod
    def of(cls, path: Path) -> "ClipFiles":
        """Finds the files of a clip; what is wrong with them is for `load_clip` to say."""
        found = dict.fromkeys([path, *_beside(path)])
        paths = tuple(file for file in found if file.is_file())
        digest = hashlib.sha256()
        for file in sorted(paths, key=lambda file: file.suffix):
            with file.open("rb") as stream:
                digest.update(hashlib.file_digest(stream, "sha256").digest())
        return cls(path, paths, digest.hexdigest())

    def packed(self) -> "Packed":
        """The files' content."""
        root = Path(os.path.commonpath([file.resolve().parent for file in self.paths]))
        content = {
            file.resolve().relative_to(root).as_posix(): file.read_bytes() for file in self.paths
        }
        name = self.path.resolve().relative_to(root).as_posix()
        return Packed(self.path, name, content)


@dataclass(frozen=True)
class Packed:
    """A clip as it travels.

    Attributes:
      path: where it came from.
      name: of the clip among the files.
      content: of the files, by their path below a common folder.
    """

    path: Path
    name: str
    content: dict[str, bytes]

    @contextmanager
    def unpacked(self) -> Iterator[Path]:
        """The clip in a folder of its own; errors name the path that it came from."""
        with tempfile.TemporaryDirectory(prefix="galileo.") as folder:
            for name, content in self.content.items():
                file = Path(folder) / name
                file.parent.mkdir(parents=True, exist_ok=True)
                file.write_bytes(content)
            try:
                yield Path(folder) / self.name
            except InputError as error:
                here = str((Path(folder) / self.name).parent)
                raise InputError(str(error).replace(here, str(self.path.parent))) from error


def _beside(path: Path) -> list[Path]:
    """The yaml of a clip, and the video or track that it names."""
    try:
        yaml = find_yaml(path)
        content = read_mapping(yaml)
    except InputError:
        return []
    named = [content.get(key) for key in ("video", "track")]
    return [yaml, *(yaml.parent / name for name in named if isinstance(name, str))]
