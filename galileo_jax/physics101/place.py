"""The Physics 101 data set as it is unpacked: a clip is known by its folders and a table of labels.

    phys101/scenarios/SCENARIO/SET-UP/OBJECT/TRIAL/Camera_1.mp4     (or OBJECT/SET-UP)
    phys101/scenarios/labels.yaml                                   what no folder tells

A ramp's set-up is its angle and its surface: 20_01. `labels.yaml`, which `galileo label` writes:

    objects:                        by folder name
      c_block_01: {shape: box, size_m: [0.05, 0.05, 0.05]}
    clips:                          by folder, from the scenario down; what stands deeper wins
      ramp: {direction: right}
      ramp/20_01: {origin_px: [1210.0, 820.0], target: w_block_02}
      ramp/20_01/c_block_01/03: {point_px: {c_block_01: [402.0, 310.5]}}

Source: J. Wu, J. J. Lim, H. Zhang, J. B. Tenenbaum, W. T. Freeman, Physics 101: learning physical
object properties from unlabeled videos, BMVC 2016.
"""

import re
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from galileo_jax.clip.fields import short
from galileo_jax.clip.load import check_clip
from galileo_jax.clip.scenarios import SCENARIOS
from galileo_jax.clip.schema import Clip
from galileo_jax.clip.yaml_file import read_mapping
from galileo_jax.runtime.errors import InputError
from galileo_jax.video import decode

LABELS = "labels.yaml"
RAMP_SETUP = re.compile(r"(\d\d)_\d\d")
VIDEO = re.compile(r"(Camera|Kinect_RGB)_\d+\.mp4")
SCALE_PX_PER_M = 107.5 / 0.0635
"""A ruler at the ramp's top, in pictures `SCALE_WIDTH_PX` wide; further down it is a little off."""

SCALE_WIDTH_PX = 1920
BY_OBJECT = ("point_px", "first_frame")
"""Keys of an object that differ from trial to trial: in `clips` they are given by object."""


@dataclass(frozen=True)
class Place:
    """Where a clip stands in the data set."""

    video: Path  # the file
    root: Path  # the folder of the scenarios, with `labels.yaml`
    scenario: str  # a name in `SCENARIOS`
    folders: tuple[str, str, str]  # the three below the scenario
    setup: str  # the one of them that names the set-up
    object: str  # the one that names the object

    @property
    def labels(self) -> Path:
        """The table of labels; it need not exist."""
        return self.root / LABELS

    @property
    def levels(self) -> tuple[str, ...]:
        """The keys of `clips` that speak of it, the most general first."""
        parts = (self.scenario, *self.folders)
        return tuple("/".join(parts[: n + 1]) for n in range(len(parts)))

    def level(self, kind: str) -> str:
        """The key of `clips` for its scenario, setup, object or trial."""
        inner = {"setup": self.setup, "object": self.object}
        at = 1 + self.folders.index(inner[kind]) if kind in inner else {"scenario": 0}.get(kind, 3)
        return self.levels[at]

    @property
    def yaml(self) -> Path:
        """The name under which the clip goes, as if it had a yaml of its own."""
        return self.video.with_name("-".join(self.folders) + ".yaml")


def place_of(path: Path) -> Place | None:
    """The place of a video in the data set; None if it is not there."""
    folders = path.resolve().parent.parts
    if not VIDEO.fullmatch(path.name) or len(folders) < 5 or folders[-4] not in SCENARIOS:
        return None
    first, second, trial = folders[-3:]
    is_setup_second = folders[-4] == "ramp" and bool(RAMP_SETUP.fullmatch(second))
    setup, thing = (second, first) if is_setup_second else (first, second)
    root = path.resolve().parents[4]
    return Place(path, root, folders[-4], (first, second, trial), setup, thing)


Labels = dict[str, dict[str, Any]]
"""`objects`: name of an object's folder to its keys; `clips`: folders to keys of the clip, of which
`target` names object 2, and `BY_OBJECT` are by object."""


def read_labels(path: Path) -> Labels:
    """A table of labels; empty without the file.

    Raises:
      InputError: it is no such table.
    """
    content = read_mapping(path) if path.is_file() else {}
    for key in content:
        if key not in ("objects", "clips"):
            raise InputError(f"{path}: {short(key)}: unknown key; known: objects, clips")
    tables = {key: _mapping(path, key, content.get(key)) for key in ("objects", "clips")}
    for key, table in tables.items():
        for name, entry in table.items():
            _mapping(path, f"{key}.{short(name)}", entry)
    return tables


def content_of(place: Place, labels: Labels) -> tuple[dict[str, Any], tuple[str, ...]]:
    """What folders and labels declare of a clip, as its yaml would, and doubts about it.

    Raises:
      InputError: the labels speak of an object that is not in the clip, or the video is broken.
    """
    declared: dict[str, Any] = {}
    by_object: dict[str, dict[str, Any]] = {}
    for level in place.levels:
        entry = dict(labels["clips"].get(level) or {})
        for key in BY_OBJECT:
            values = _mapping(place.labels, f"clips.{level}.{key}", entry.pop(key, None))
            for name, value in values.items():
                by_object.setdefault(name, {})[key] = value
        declared |= entry
    names = [place.object, *([target] if (target := declared.pop("target", None)) else [])]
    for name in by_object:
        if name not in names:
            raise InputError(
                f"{place.labels}: clips: {short(name)} is not in {place.levels[-1]}; "
                f"its objects are {', '.join(map(short, names))}"
            )
    objects = [
        {
            "name": re.sub(r"\W", "_", str(name)),
            "shape": "box",
            **(labels["objects"].get(name) or {}),
            **by_object.get(name, {}),
        }
        for name in names
    ]
    defaults = _defaults(place)
    warnings = ()
    if "pixels_per_metre" in defaults.keys() - declared.keys():
        warnings = (
            f"{place.video}: pixels_per_metre: {defaults['pixels_per_metre']:g} is used, from "
            "107.5 pixels to 6.35 cm at the ramp's top; `galileo label --scale` declares another",
        )
    content = {"video": place.video.name, **defaults, **declared, "objects": objects}
    return content, warnings


def _defaults(place: Place) -> dict[str, Any]:
    info = decode.probe(place.video)
    found: dict[str, Any] = {"scenario": place.scenario, "fps": round(info.fps, 4)}
    if place.scenario == "ramp":
        match = RAMP_SETUP.fullmatch(place.setup)
        found["ramp_angle_deg"] = float(match[1]) if match else None
        scale = SCALE_PX_PER_M * info.size_px[0] / SCALE_WIDTH_PX
        found["pixels_per_metre"] = round(scale, 3)
    return found


def _mapping(path: Path, key: str, value: Any) -> dict[str, Any]:
    if value is None:
        return {}
    if not isinstance(value, dict):
        raise InputError(f"{path}: {key}: {short(value)} is not a mapping")
    return value


def check_place(place: Place, labels: Labels, given: dict[str, Any] | None = None) -> Clip:
    """Checks a clip of Physics 101, which its folders and its labels declare.

    `given` wins over both.

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
