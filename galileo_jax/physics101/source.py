"""Physics 101 as a source of clips: loaded, labelled, and told apart by what their labels say."""

import json
from pathlib import Path
from typing import Any

from galileo_jax.clip.declaration import Declaration
from galileo_jax.clip.label import LabelledClip, updated_file
from galileo_jax.clip.schema import Clip
from galileo_jax.clip.sources import SOURCES, ClipSource, SourceFiles
from galileo_jax.clip.yaml_file import yaml_text
from galileo_jax.physics101.place import BY_OBJECT, Place, check_place, place_of, read_labels
from galileo_jax.runtime.atomic_write import write_text
from galileo_jax.runtime.errors import InputError


def _load(path: Path, given: dict[str, Any]) -> Clip:
    place = _place(path)
    return check_place(place, read_labels(place.labels), given)


def _files(path: Path) -> SourceFiles:
    """A label of another clip does not make it another."""
    place = _place(path)
    paths = tuple(file for file in (path, place.labels) if file.is_file())
    try:
        labels = read_labels(place.labels)
    except InputError:
        said = None
    else:
        own = [labels["clips"].get(level) for level in place.levels]
        said = [place.levels[-1], labels["objects"], own]
    return SourceFiles(place.yaml.stem, place.root, paths, json.dumps(said, sort_keys=True))


def _place(path: Path) -> Place:
    place = place_of(path)
    assert place is not None, "only what is recognised is loaded"
    return place


def _label(path: Path, declared: Declaration) -> LabelledClip:
    """Writes into the labels of Physics 101: sizes by object, all else for one of the folders.

    Raises:
      InputError: nothing is declared, or the clip would be wrong; nothing is written then.
    """
    place = _place(path)
    if declared.scenario is not None:
        raise InputError(f"--scenario: the folders of {place.video} say {place.scenario}")
    labels = read_labels(place.labels)
    things, clips = labels["objects"], labels["clips"]
    here, objects = declared.clip_values(), declared.object_values()
    if not here and not objects:
        raise InputError(f"{place.video}: nothing to write; see galileo label --help")
    by_trial: dict[str, dict[str, Any]] = {}
    for name, values in objects.items():
        if name != place.object:
            here["target"] = name
        things[name] = dict(things.get(name, {"shape": "box"}) or {})
        for key, value in values.items():
            if key in BY_OBJECT:
                by_trial.setdefault(key, {})[name] = value
            else:
                things[name][key] = value
    if here:
        level = place.level(declared.level)
        clips[level] = (clips.get(level) or {}) | here
    trial = clips.setdefault(place.levels[-1], {}) if by_trial else {}
    for key, values in by_trial.items():
        trial[key] = (trial.get(key) or {}) | values
    clip = check_place(place, labels)
    content = {key: table for key, table in labels.items() if table}
    text, notes = yaml_text(content), ()
    if place.labels.is_file():
        text, notes = updated_file(place.labels, content)
    write_text(place.labels, text)
    return LabelledClip(place.labels, clip, notes)


SOURCES.register(
    ClipSource("physics101", lambda path: place_of(path) is not None, _load, _label, _files)
)
