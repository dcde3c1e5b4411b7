"""A cell of a sweep: clips, settings, and a name made from their content."""

import hashlib
import json
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

from galileo_jax import __version__
from galileo_jax.sweeping.clip_files import ClipFiles
from galileo_jax.sweeping.settings import Settings

NAME_LENGTH = 40  # of the part that is there to be read


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
