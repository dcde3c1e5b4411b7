"""Physics 101 as a source of clips: loaded, checked, and told apart by what their labels say."""

import json
from pathlib import Path
from typing import Any

from galileo_jax.clip.load import check_clip
from galileo_jax.clip.schema import Clip
from galileo_jax.clip.sources import SOURCES, ClipSource, SourceFiles
from galileo_jax.physics101.place import Labels, Place, content_of, place_of, read_labels
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


def check_place(place: Place, labels: Labels, given: dict[str, Any] | None = None) -> Clip:
    """Checks a clip of Physics 101, which its folders and its labels declare.

    Args:
      place: where it is.
      labels: of the data set.
      given: values that win over both.

    Raises:
      InputError: one line, which names the labels, for whatever is wrong.
    """
    content, warnings = content_of(place, labels)
    given = given or {}
    try:
        clip = check_clip(place.yaml, content | given, overridden=frozenset(given))
    except InputError as error:
        named = f"{place.labels}: clips: {place.levels[-1]}"
        raise InputError(str(error).replace(str(place.yaml), named)) from None
    noted = () if "pixels_per_metre" in given else warnings
    return clip.model_copy(update={"warnings": clip.warnings + noted})


def _place(path: Path) -> Place:
    place = place_of(path)
    assert place is not None, "only what is recognised is loaded"
    return place
