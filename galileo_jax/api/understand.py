"""`understand`: what a film or table shows, what its yaml declares, and what is still open."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from galileo_jax.api.look import Look, look
from galileo_jax.clip.load import YAML_SUFFIXES, check_clip, has_yaml
from galileo_jax.clip.look import Likely, likely_in_plane, usual_shape
from galileo_jax.clip.scenarios import SCENARIOS
from galileo_jax.clip.scenarios.scenario import Scenario
from galileo_jax.clip.yaml_file import read_mapping
from galileo_jax.runtime import progress
from galileo_jax.runtime.errors import InputError

USUAL_FPS = 30.0

Point = tuple[float, float]
Answers = Mapping[str, Any]
"""What a person said, by key of the yaml; None: that nobody knows it. `points`: of the objects."""


@dataclass(frozen=True)
class FilmPath:
    """The way that a thing takes through a film.

    Attributes:
      likely: the kind of motion; None where the thing cannot be followed.
      direction: in which it goes in the picture.
      moved_px: how far from one end of its way to the other.
    """

    likely: Likely | None
    direction: str = "right"
    moved_px: float = 0.0


@dataclass(frozen=True, eq=False)
class Understood:
    """What a film or table shows, and what is declared beside it.

    Attributes:
      source: the film or table.
      yaml_path: of the yaml beside it, which need not be there.
      declared: what it says; empty where there is none.
      look: what `look` makes of the source.
      things: what moves in a film whose yaml names no objects, to its size in the picture, px.
      foot: of a ramp that such a film shows, px; None: it shows none.
      is_pair: one thing sets out after the other, as on a ramp into another.
      unseen: why nothing that moves was found, one line; "" where something was.
    """

    source: Path
    yaml_path: Path
    declared: Mapping[str, Any]
    look: Look
    things: Mapping[Point, Point] = field(default_factory=dict)
    foot: Point | None = None
    is_pair: bool = False
    unseen: str = ""
    _paths: dict[Point, FilmPath] = field(default_factory=dict, repr=False)

    @property
    def is_film(self) -> bool:
        """Whether the source is a film."""
        return self.look.seen is None

    @property
    def has_objects(self) -> bool:
        """Whether somebody declared the objects."""
        return bool(self.declared.get("objects"))

    def points(self, answers: Answers) -> Sequence[Point]:
        """Where a film's objects are in its first frame, in their order; empty where nobody knows.

        All things that move as a pair, else the first, where a person said no other.
        """
        if "points" in answers:
            return answers["points"]
        return list(self.things)[: 2 if self.is_pair else 1]

    def likely(self, answers: Answers) -> Likely | None:
        """The likeliest kind of motion, of a film of the thing that was chosen; None: unknown."""
        if (seen := self.look.seen) is not None:
            return Likely(seen.scenario, seen.why, seen.is_clear, seen.slope_deg)
        points = self.points(answers)
        if len(points) == 1:
            return self.path(points[0]).likely
        return Likely("ramp", "two things move, one after the other") if points else None

    def scenario(self, answers: Answers) -> Scenario | None:
        """The kind of motion: as declared, as answered, as it seems; None: nobody knows."""
        likely = self.likely(answers) if not {"scenario"} & {*self.declared, *answers} else None
        name = self.declared.get("scenario") or answers.get("scenario")
        name = name or (likely.scenario if likely else None)
        return SCENARIOS.get(name) if name is not None and name in SCENARIOS else None

    def path(self, point: Point) -> FilmPath:
        """The way of the thing at a place of the first frame; it is followed once."""
        if point not in self._paths:
            self._paths[point] = _followed(
                self.source, self.yaml_path, point, self.look.fps or USUAL_FPS
            )
        return self._paths[point]


def understand(file: str | Path) -> Understood:
    """Looks at a film or table, or at the one that a yaml names; nothing is written.

    What moves is looked for in a film whose yaml names no objects.

    Raises:
      InputError: there is no such file, or it cannot be read.
    """
    path = Path(file)
    is_yaml = path.suffix.lower() in YAML_SUFFIXES
    yaml_path = path if is_yaml else _beside(path)
    declared = read_mapping(yaml_path) if yaml_path.is_file() else {}
    source = path
    if is_yaml and path.is_file():
        named = declared.get("video") or declared.get("track")
        if named is None:
            raise InputError(f"{path}: video, track: missing; one of them expected")
        source = path.parent / str(named)
    fps = declared.get("fps")
    found = look(source, fps=float(fps) if isinstance(fps, int | float) and fps > 0 else None)
    known = Understood(source, yaml_path, declared, found)
    if not known.is_film or known.has_objects:
        return known
    return _with_things(known)


def is_declared(file: str | Path) -> bool:
    """Whether a yaml is there that leaves nothing open which a person is asked for.

    What is wrong with it is for `load` to say.
    """
    path = Path(file)
    is_yaml = path.suffix.lower() in YAML_SUFFIXES
    yaml_path = path if is_yaml else _beside(path)
    if not yaml_path.is_file():
        return False
    declared = read_mapping(yaml_path)
    scenario = declared.get("scenario")
    if scenario is None or not declared.get("objects"):
        return False
    if declared.get("video") is not None and "fps" not in declared:
        return False
    kind = SCENARIOS.get(str(scenario)) if str(scenario) in SCENARIOS else None
    return kind is None or not needs_angle(kind) or "ramp_angle_deg" in declared


def needs_angle(scenario: Scenario) -> bool:
    """Whether a clip of this kind declares the angle of a ramp."""
    return scenario.has_ramp and scenario.angle_deg is None


def _beside(path: Path) -> Path:
    if not has_yaml(path):
        return path.with_suffix(YAML_SUFFIXES[0])
    return next(p for s in YAML_SUFFIXES if (p := path.with_suffix(s)).is_file())


def _with_things(known: Understood) -> Understood:
    """What moves in a film; nothing where nothing is found, which a person can mend."""
    from galileo_jax.api.propose import propose

    try:
        proposal = propose(known.source)
    except InputError as error:
        return replace(known, unseen=str(error).removeprefix(f"{known.source}: "))
    things = {point: proposal.sizes_px[name] for name, point in proposal.objects.items()}
    is_pair = len(things) > 1 and not proposal.doubts
    foot = proposal.foot if proposal.scenario == "ramp" else None
    return replace(known, things=things, foot=foot, is_pair=is_pair)


def _followed(source: Path, yaml_path: Path, point: Point, fps: float) -> FilmPath:
    from galileo_jax.measurement.track_cache import track_once

    item = {"name": "object1", "shape": usual_shape(""), "point_px": list(point)}
    content = {"video": source.name, "scenario": "flight", "objects": [item]}
    progress.report("following what moves", 0.9)
    try:
        clip = check_clip(yaml_path, content | {"fps": fps})
        track = track_once(clip)
    except InputError:
        return FilmPath(None)
    x, y = track.position_px[0][track.is_visible[0]].T
    if len(x) < 3:
        return FilmPath(None)
    direction = "right" if x[np.argmax(abs(x - x[0]))] >= x[0] else "left"
    moved = float(np.hypot(np.ptp(x), np.ptp(y)))
    return FilmPath(likely_in_plane(x, y), direction, moved)
