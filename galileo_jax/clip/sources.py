"""Clip sources: data sets whose clips are declared by other files than a yaml beside the video.

A package beside the core registers one; `load_clip` and sweeps then take its clips by their path.
"""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from galileo_jax.runtime.registry import Registry

if TYPE_CHECKING:
    from galileo_jax.clip.declaration import Declaration
    from galileo_jax.clip.label import LabelledClip
    from galileo_jax.clip.schema import Clip


@dataclass(frozen=True)
class SourceFiles:
    """What a clip consists of."""

    name: str  # that it goes by
    root: Path  # a folder above all its files
    paths: tuple[Path, ...]  # its files, as far as they are there
    declared: str  # what is declared about it, as text that is the same only if that is


@dataclass(frozen=True)
class ClipSource:
    """A data set; what its functions refuse is an `InputError`, one line."""

    name: str  # in the registry
    # whether a video, which has no yaml beside it, belongs to it
    recognises: Callable[[Path], bool]
    # the checked clip of a video; values that are given win over what is declared
    load: Callable[[Path, dict[str, Any]], "Clip"]
    # writes what a user says about a video where the data set keeps it, or nothing
    label: Callable[[Path, "Declaration"], "LabelledClip"]
    # the files of a video's clip; what is wrong with them is for `load` to say
    files: Callable[[Path], SourceFiles]


SOURCES: Registry[ClipSource] = Registry("clip source", "clip sources")


def source_of(path: Path) -> ClipSource | None:
    """The source that recognises a video; None where none does."""
    return next((source for source in SOURCES.values() if source.recognises(path)), None)
