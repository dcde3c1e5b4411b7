"""The files of a clip: found, told apart by their content, and carried to another machine."""

import hashlib
import os
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

from galileo_jax.clip.load import find_yaml, has_yaml
from galileo_jax.clip.sources import source_of
from galileo_jax.clip.yaml_file import read_mapping
from galileo_jax.runtime.errors import InputError


@dataclass(frozen=True)
class ClipFiles:
    """A clip as it lies on disk.

    Attributes:
      path: as the clip was named: its video, its yaml, or its track.
      name: that it goes by.
      root: a folder above all its files.
      paths: its files, as far as they are there.
      digest: of the files' content.
    """

    path: Path
    name: str
    root: Path
    paths: tuple[Path, ...]
    digest: str

    @classmethod
    def of(cls, path: Path) -> "ClipFiles":
        """Finds the files of a clip; what is wrong with them is for `load_clip` to say."""
        if not has_yaml(path) and (source := source_of(path)):
            found = source.files(path)
            digest = _digest([path], found.declared)
            return cls(path, found.name, found.root, found.paths, digest)
        found = dict.fromkeys([path, *_beside(path)])
        paths = tuple(file for file in found if file.is_file())
        root = Path(os.path.commonpath([file.resolve().parent for file in paths]))
        return cls(path, path.stem, root, paths, _digest(paths))

    def packed(self) -> "Packed":
        """The files' content."""
        below = {path: path.resolve().relative_to(self.root).as_posix() for path in self.paths}
        content = {name: path.read_bytes() for path, name in below.items()}
        return Packed(self.path, self.root, below[self.path], content)


@dataclass(frozen=True)
class Packed:
    """A clip as it travels.

    Attributes:
      path: where it came from.
      root: the folder that its files were below.
      name: of the clip's own file among them.
      content: of the files, by their path below the root.
    """

    path: Path
    root: Path
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
            clip = Path(folder) / self.name
            try:
                yield clip
            except InputError as error:
                said = str(error).replace(str(clip.parent), str(self.path.parent))
                raise InputError(said.replace(folder, str(self.root))) from error


def _beside(path: Path) -> list[Path]:
    """The yaml of a clip, and the video or track that it names."""
    try:
        yaml = find_yaml(path)
        content = read_mapping(yaml)
    except InputError:
        return []
    named = [content.get(key) for key in ("video", "track")]
    return [yaml, *(yaml.parent / name for name in named if isinstance(name, str))]


def _digest(paths: list[Path] | tuple[Path, ...], more: str = "") -> str:
    """Of the files' content, whatever they are called."""
    digest = hashlib.sha256(more.encode())
    for path in sorted(paths, key=lambda path: path.suffix):
        with path.open("rb") as stream:
            digest.update(hashlib.file_digest(stream, "sha256").digest())
    return digest.hexdigest()
