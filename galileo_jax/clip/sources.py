"""Clip sources: data sets whose clips are declared by other files than a yaml beside the video.

A package beside the core registers one; `load_clip` and sweeps then take its clips by their path.
"""

from abc import ABC, abstractmethod
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar

from galileo_jax.runtime.registry import Registry

if TYPE_CHECKING:
    from galileo_jax.clip.declaration import Declaration
    from galileo_jax.clip.label import LabelledClip
    from galileo_jax.clip.schema import Clip


@dataclass(frozen=True)
class SourceFiles:
    """What a clip consists of.

    Attributes:
      name: that it goes by.
      root: a folder above all its files.
      paths: its files, as far as they are there.
      declared: what is declared about it, as text that is the same only if that is.
    """

    name: str
    root: Path
    paths: tuple[Path, ...]
    declared: str


class ClipSource(ABC):
    """A data set.

    Attributes:
      name: in the registry.
    """

    name: ClassVar[str]

    @staticmethod
    @abstractmethod
    def recognises(path: Path) -> bool:
        """Whether a video, which has no yaml beside it, belongs to the data set."""

    @staticmethod
    @abstractmethod
    def load(path: Path, given: dict[str, Any]) -> "Clip":
        """The checked clip of a video; `given` are values that win over what is declared.

        Raises:
          InputError: one line, for whatever is wrong.
        """

    @staticmethod
    @abstractmethod
    def label(path: Path, declared: "Declaration") -> "LabelledClip":
        """Writes what a user says about a video where the data set keeps it.

        Raises:
          InputError: one line; nothing is written then.
        """

    @staticmethod
    @abstractmethod
    def files(path: Path) -> SourceFiles:
        """The files of a video's clip; what is wrong with them is for `load` to say."""


SOURCES: Registry[type[ClipSource]] = Registry("clip source", "clip sources")


def source_of(path: Path) -> type[ClipSource] | None:
    """The source that recognises a video; None where none does."""
    return next((source for source in SOURCES.values() if source.recognises(path)), None)
