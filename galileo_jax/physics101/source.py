"""Physics 101 as a source of clips: loaded, checked, and told apart by what their labels say."""

import json
from pathlib import Path
from typing import Any

from galileo_jax.clip.declaration import Declaration
from galileo_jax.clip.label import LabelledClip
from galileo_jax.clip.schema import Clip
from galileo_jax.clip.sources import SOURCES, ClipSource, SourceFiles
from galileo_jax.physics101.label import label_place
from galileo_jax.physics101.place import Place, check_place, place_of, read_labels
from galileo_jax.runtime.errors import InputError


@SOURCES.register
class Physics101(ClipSource):
    """Videos in folders named as the data set names them."""

    name = "physics101"

    @staticmethod
    def recognises(path: Path) -> bool:
        """See `ClipSource`."""
        return place_of(path) is not None

    @staticmethod
    def load(path: Path, given: dict[str, Any]) -> Clip:
        """See `ClipSource`."""
        place = _place(path)
        return check_place(place, read_labels(place.labels), given)

    @staticmethod
    def label(path: Path, declared: Declaration) -> LabelledClip:
        """See `ClipSource`."""
        return label_place(_place(path), declared)

    @staticmethod
    def files(path: Path) -> SourceFiles:
        """See `ClipSource`. A label of another clip does not make it another."""
        place = _place(path)
        paths = tuple(file for file in (path, place.labels) if file.is_file())
        try:
            labels = read_labels(place.labels)
        except InputError:
            said = None
        else:
            own = [labels.clips.get(level) for level in place.levels]
            said = [place.levels[-1], labels.things, own]
        return SourceFiles(place.yaml.stem, place.root, paths, json.dumps(said, sort_keys=True))


def _place(path: Path) -> Place:
    place = place_of(path)
    assert place is not None, "only what is recognised is loaded"
    return place
