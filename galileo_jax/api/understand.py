"""`understand`: what a film or table shows, what its yaml declares, and what is still open."""

import shlex
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from galileo_jax.api.look import Look, look
from galileo_jax.clip.load import check_clip, yaml_of
from galileo_jax.clip.look import Likely, likely_in_plane, usual_shape
from galileo_jax.clip.scenarios import SCENARIOS
from galileo_jax.clip.scenarios.scenario import Scenario
from galileo_jax.clip.track_csv import MAX_STEP_S
from galileo_jax.clip.track_file import is_track
from galileo_jax.clip.yaml_file import read_mapping
from galileo_jax.runtime import progress
from galileo_jax.runtime.errors import InputError

USUAL_FPS = 30.0
MOST_PICTURES = 6000
"""Of a film in which a motion is looked for: to look at one takes up to 10 ms, and nobody waits for
more than a minute; 200 s of a phone's film, 25 s of slow motion."""

Point = tuple[float, float]
Answers = Mapping[str, Any]
"""What a person said, by key of the yaml; None: that nobody knows it. `points`: of the objects."""


@dataclass(frozen=True, eq=False)
class FilmPath:
    """The way that a thing takes through a film.

    Attributes:
      likely: the kind of motion; None where the thing cannot be followed.
      direction: in which it goes in the picture.
      way_px: `[2, place]`, where it is one picture after the other; None: not known.
    """

    likely: Likely | None
    direction: str = "right"
    way_px: np.ndarray | None = None

    @property
    def moved_px(self) -> float:
        """How far from one end of its way to the other."""
        return 0.0 if self.way_px is None else float(np.hypot(*np.ptp(self.way_px, axis=1)))


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
      unseen: why no moving thing was found in such a film; "" where one was.
      is_pair: one thing sets out after the other, as on a ramp into another.
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

        All things that move as a pair, else the likeliest, where a person said no other.
        """
        if "points" in answers:
            return answers["points"]
        return list(self.things)[:2] if self.is_pair else list(filter(None, [self.likeliest]))

    @property
    def likeliest(self) -> Point | None:
        """The first thing that moves as one kind of motion alone does; else the first that moves.

        A hand that lets something go moves, too, and before it.
        """
        every = list(self.things)
        if len(every) < 2:
            return every[0] if every else None
        kinds = ((point, self.path(point).likely) for point in every)
        return next((point for point, kind in kinds if kind and kind.is_clear), every[0])

    def likely(self, answers: Answers) -> Likely | None:
        """The likeliest kind of motion, of a film of the thing that was chosen; None: unknown."""
        if (seen := self.look.seen) is not None:
            return seen
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
    source = path = Path(file)
    yaml_path = yaml_of(path)
    declared = read_mapping(yaml_path) if yaml_path.is_file() else {}
    if path == yaml_path and path.is_file():
        named = declared.get("video") or declared.get("track")
        if named is None:
            raise InputError(f"{path}: video, track: missing; one of them expected")
        source = path.parent / str(named)
    if not is_track(source):
        _check_length(source)
    fps = declared.get("fps")
    found = look(source, fps=float(fps) if isinstance(fps, int | float) and fps > 0 else None)
    _check_clock(found)
    known = Understood(source, yaml_path, declared, found)
    if not known.is_film or known.has_objects:
        return known
    return _with_things(known)


def is_declared(file: str | Path) -> bool:
    """Whether a yaml is there that leaves nothing open which a person is asked for.

    What is wrong with it is for `load` to say.
    """
    yaml_path = yaml_of(Path(file))
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


def _check_length(film: Path) -> None:
    """Refuses a film that is much longer than a motion, before it is looked through."""
    from galileo_jax.video.decode import announced

    count, seconds = announced(film)
    if count <= MOST_PICTURES:
        return
    long = f"{seconds / 60:.0f} minutes" if seconds >= 120 else f"{seconds:.0f} s"
    raise InputError(
        f"{film}: {long} of film, {count} pictures; one motion is wanted, in {MOST_PICTURES} "
        "pictures at most: cut it out, such as the 10 s from 1 min 30 s on with: "
        f"ffmpeg -ss 90 -t 10 -i {shlex.quote(film.name)} motion.mp4"
    )


def _check_clock(found: Look) -> None:
    """Refuses a table whose rows are too far apart in time to show a motion."""
    seen = found.seen
    if seen is None or seen.is_in_frames or not seen.step >= MAX_STEP_S:
        return
    raise InputError(
        f"{found.path}: its rows are {seen.step:g} s apart: no motion shows in that; a table of "
        f"places less than {MAX_STEP_S:g} s apart expected (if its times are milliseconds or "
        "frame numbers, divide them by 1000 or by the frame rate)"
    )


def _with_things(known: Understood) -> Understood:
    """What moves in a film; nothing where nothing is found, which a person can mend."""
    from galileo_jax.api.propose import propose

    try:
        proposal = propose(known.source)
    except InputError as error:
        why = str(error).removeprefix(f"{known.source}: ")
        return replace(known, unseen=why.removesuffix("; mark the objects by hand"))
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
    return FilmPath(likely_in_plane(x, y), direction, np.stack([x, y]))
