"""A cell of a sweep: clips, settings, and a name made from their content.

The files of a clip are found, told apart by their content, and carried to another machine.
"""

import hashlib
import json
import os
import tempfile
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

from galileo_jax import __version__
from galileo_jax.clip.load import find_yaml, has_yaml
from galileo_jax.clip.sources import source_of
from galileo_jax.clip.yaml_file import read_mapping
from galileo_jax.runtime.errors import InputError
from galileo_jax.sweeping.settings import Settings

NAME_LENGTH = 40  # of the part that is there to be read


@dataclass(frozen=True)
class ClipFiles:
    """A clip as it lies on disk."""

    source: str  # the clip as it was named: its video, its yaml, or its track
    name: str  # that it goes by
    root: Path  # a folder above all its files
    paths: tuple[Path, ...]  # its files, as far as they are there
    digest: str  # of the files' content

    @classmethod
    def of(cls, source: str | Path) -> "ClipFiles":
        """Finds the files of a clip; what is wrong with them is for `load_clip` to say."""
        source, path = str(source), Path(source)
        if not has_yaml(path) and (other := source_of(path)):
            found = other.files(path)
            digest = _digest([path], found.declared)
            return cls(source, found.name, found.root, found.paths, digest)
        found = dict.fromkeys([path, *_beside(path)])
        paths = tuple(file for file in found if file.is_file())
        root = Path(os.path.commonpath([file.resolve().parent for file in paths]))
        return cls(source, path.stem, root, paths, _digest(paths))

    @property
    def path(self) -> Path:
        """The file that was named."""
        return Path(self.source)

    @property
    def key(self) -> str:
        """The same for the same content under the same name: a track's messages name its file."""
        return hashlib.sha256(f"{self.digest} {self.source}".encode()).hexdigest()

    def packed(self) -> "Packed":
        """The files' content."""
        below = {path: path.resolve().relative_to(self.root).as_posix() for path in self.paths}
        content = {name: path.read_bytes() for path, name in below.items()}
        return Packed(self.source, self.root, below[self.path], content)


@dataclass(frozen=True)
class Packed:
    """A clip as it travels."""

    source: str  # where it came from, as it was named
    root: Path  # the folder that its files were below
    name: str  # of the clip's own file among them
    content: dict[str, bytes]  # of the files, by their path below the root

    @contextmanager
    def unpacked(self) -> Iterator[tuple[Path, Callable[[str], str]]]:
        """The clip in a folder of its own.

        Yields its file, and what gives a text the names of files as they were where they came
        from. Errors have these names, too.
        """
        with tempfile.TemporaryDirectory(prefix="galileo.") as folder:
            for name, content in self.content.items():
                file = Path(folder) / name
                file.parent.mkdir(parents=True, exist_ok=True)
                file.write_bytes(content)
            clip = Path(folder) / self.name
            origins = {clip.parent: Path(self.source).parent}
            origins.setdefault(Path(folder), self.root)  # the innermost folder first

            def as_named(text: str) -> str:
                for here, there in origins.items():
                    text = text.replace(f"{here}/", f"{there}/" if there != Path(".") else "")
                    text = text.replace(str(here), str(there))
                return text

            try:
                yield clip, as_named
            except InputError as error:
                raise InputError(as_named(str(error))) from error


def _beside(path: Path) -> list[Path]:
    """The yaml of a clip, and the video or the tables that it names."""
    try:
        yaml = find_yaml(path)
        content = read_mapping(yaml)
    except InputError:
        return []
    named = [content.get(key) for key in ("video", "track")]
    objects = content.get("objects")
    items = objects if isinstance(objects, list) else []
    named += [item.get("track_file") for item in items if isinstance(item, dict)]
    return [yaml, *(yaml.parent / name for name in named if isinstance(name, str))]


def _digest(paths: list[Path] | tuple[Path, ...], more: str = "") -> str:
    """Of the files' content, whatever they are called."""
    digest = hashlib.sha256(more.encode())
    for path in sorted(paths, key=lambda path: path.suffix):
        with path.open("rb") as stream:
            digest.update(hashlib.file_digest(stream, "sha256").digest())
    return digest.hexdigest()


@dataclass(frozen=True)
class Cell:
    """Clips that are fitted together, and how."""

    clips: tuple[ClipFiles, ...]
    settings: Settings

    @property
    def name(self) -> str:
        """The same for the same options, content of the clips' files and version."""
        content = {
            "clips": [clip.digest for clip in self.clips],
            "settings": self.settings.model_dump(mode="json"),
            "version": __version__,
        }
        digest = hashlib.sha256(json.dumps(content, sort_keys=True).encode()).hexdigest()
        names = "+".join(clip.name for clip in self.clips)
        return f"{names[:NAME_LENGTH]}-{self.settings.method}-{digest[:16]}"


def make_cells(
    groups: Iterable[Sequence[ClipFiles]], settings: Iterable[Settings]
) -> tuple[Cell, ...]:
    """All groups of clips with all settings, settings outermost; each cell once."""
    groups = tuple(groups)
    cells = (Cell(tuple(group), one) for one in settings for group in groups)
    return tuple({cell.name: cell for cell in cells}.values())
