"""What a film or table shows, in words and in a picture; what its yaml says and leaves open."""

import math
import shlex
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from galileo_jax.api.look import Look, look
from galileo_jax.clip.file_kinds import is_track
from galileo_jax.clip.load import check_clip, yaml_of
from galileo_jax.clip.look import LEVEL_DEG, Likely, Seen, likely_in_plane, usual_shape
from galileo_jax.clip.scenarios import SCENARIOS, Scenario
from galileo_jax.clip.schema import Clip
from galileo_jax.clip.track_axes import goes_right
from galileo_jax.clip.track_csv import MAX_STEP_S
from galileo_jax.clip.yaml_file import read_mapping
from galileo_jax.measurement.segments.rest import rests_of, runs_between
from galileo_jax.observation.observation import PointPath
from galileo_jax.report.marked_picture import Marked, write_marked_picture
from galileo_jax.report.phrases import listed
from galileo_jax.runtime import progress
from galileo_jax.runtime.errors import InputError

KINDS = {
    "from_above": "a motion seen from above",
    "level": "a slide along a level table",
    "liquid": "a fall in a liquid",
    "multi": "several objects on a ramp",
}
HOW = {"a ": "along", "one coordinate": "in", "turns": "and", "an angle": "as"}
"""What stands before what speaks for a kind of motion."""

PICTURE = "what_moves.png"
USUAL_FPS = 30.0
NEAR = 0.1  # of its size: what went so far has set out
RUN = 0.2  # of the longest way between two rests: what goes less far is no motion of its own
MOST_PICTURES = 6000
"""Of a film in which a motion is looked for: to look at one takes up to 10 ms, and nobody waits for
more than a minute; 200 s of a phone's film, 25 s of slow motion."""

Point = tuple[float, float]
Answers = Mapping[str, Any]
"""What a person said, by key of the yaml; None: that nobody knows it. `points`: of the objects."""


@dataclass(frozen=True, eq=False)
class FilmPath:
    """The way that a thing takes through a film, and in which `direction` of the picture.

    `likely`: the kind of motion; None where the thing cannot be followed. `way_px`: `[2, place]`,
    where it is in each of `frames`; None: not known.
    """

    likely: Likely | None
    direction: str = "right"
    way_px: np.ndarray | None = None
    frames: np.ndarray = field(default_factory=lambda: np.zeros(0, int))

    def place(self, frame: int) -> Point:
        """Where it is in one of `frames`."""
        assert self.way_px is not None  # of a thing with frames
        x, y = self.way_px[:, np.searchsorted(self.frames, frame)]
        return float(x), float(y)

    @property
    def moved_px(self) -> float:
        """How far from one end of its way to the other."""
        return 0.0 if self.way_px is None else float(np.hypot(*np.ptp(self.way_px, axis=1)))


@dataclass(frozen=True, eq=False)
class Understood:
    """What a film or table shows, what is declared beside it, and what a person answers."""

    source: Path  # the film or table
    yaml_path: Path  # of the yaml beside it, which need not be there
    declared: Mapping[str, Any]  # what it says; empty where there is none
    look: Look  # what `look` makes of the source
    # What moves in a film whose yaml names no objects, to its size in the picture, px.
    things: Mapping[Point, Point] = field(default_factory=dict)
    # In which of these are first seen that come later.
    first_frames: Mapping[Point, int] = field(default_factory=dict)
    foot: Point | None = None  # of a ramp that such a film shows, px; None: it shows none
    is_on_ramp: bool = False  # its first look shows two things on a ramp, one after the other
    unseen: str = ""  # why no moving thing was found in such a film; "" where one was
    answers: Answers = field(default_factory=dict)
    _paths: dict[Point, FilmPath] = field(default_factory=dict, repr=False)

    def with_answers(self, answers: Answers) -> "Understood":
        """The same after more answers."""
        return replace(self, answers={**self.answers, **answers})

    @cached_property
    def is_pair(self) -> bool:
        """Whether one thing runs into another, which sets out then."""
        return self.is_on_ramp or _meet(self)

    @property
    def is_film(self) -> bool:
        """Whether the source is a film."""
        return self.look.seen is None

    @property
    def has_objects(self) -> bool:
        """Whether somebody declared the objects."""
        return bool(self.declared.get("objects"))

    @property
    def points(self) -> Sequence[Point]:
        """Where a film's objects are in its first frame, in their order; empty where nobody knows.

        All things that move as a pair, else the likeliest, where a person said no other.
        """
        if "points" in self.answers:
            return self.answers["points"]
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

    @property
    def likely(self) -> Likely | None:
        """The likeliest kind of motion, of a film of the thing that was chosen; None: unknown."""
        if (seen := self.look.seen) is not None:
            return seen
        if len(self.points) == 1:
            return self.path(self.points[0]).likely
        return self._likely_of_pair(self.points[1]) if self.points else None

    def _likely_of_pair(self, struck: Point) -> Likely:
        """Of two things that meet; `struck`: the one that is run into."""
        why = "two things move, one after the other"
        path = None if self.foot is not None else self.path(struck)
        slope = path.likely.slope_deg if path is not None and path.likely is not None else None
        if slope is None or slope <= LEVEL_DEG:
            return Likely("ramp", why)
        return Likely("from_above", f"{why}, and what is struck goes off at {slope:.0f} degrees")

    @property
    def said_scenario(self) -> str | None:
        """Name of the kind of motion that a person declares or answers."""
        return self.declared.get("scenario") or self.answers.get("scenario")

    @property
    def scenario(self) -> Scenario | None:
        """The kind of motion: as declared, as answered, as it seems; None: nobody knows."""
        name = self.said_scenario
        if name is None and "scenario" not in {*self.declared, *self.answers}:
            name = likely.scenario if (likely := self.likely) else None
        return SCENARIOS[name] if name is not None and name in SCENARIOS else None

    def first_frame(self, point: Point) -> int:
        """In which frame the thing at a place is first seen; 0 where nothing is known to come."""
        for place, frame in self.first_frames.items():
            if math.dist(point, place) <= max(self.things[place]) / 2:
                return frame
        return 0

    def path(self, point: Point) -> FilmPath:
        """The way of the thing at a place where it is first seen; it is followed once."""
        if point not in self._paths:
            self._paths[point] = _followed(self, point)
        return self._paths[point]


def understand(file: str | Path) -> Understood:
    """Looks at a film or table, or at the one that a yaml names; nothing is written.

    What moves is looked for in a film whose yaml names no objects.
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
    return _with_things(known) if known.is_film and not known.has_objects else known


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
    is_film = declared.get("track") is None and not is_track(Path(file))
    if (is_film or declared.get("video") is not None) and "fps" not in declared:
        return False
    is_known = str(scenario) in SCENARIOS
    has_angle = "ramp_angle_deg" in declared
    return has_angle or not is_known or not SCENARIOS[str(scenario)].is_sloped


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
    if seen is not None and not seen.is_in_frames and seen.step >= MAX_STEP_S:
        raise InputError(
            f"{found.path}: its rows are {seen.step:g} s apart: no motion shows in that; a table "
            f"of places less than {MAX_STEP_S:g} s apart expected (if its times are milliseconds "
            "or frame numbers, divide them by 1000 or by the frame rate)"
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
    is_ramp = proposal.scenario == "ramp"
    return replace(
        known,
        things=things,
        first_frames={proposal.objects[name]: at for name, at in proposal.first_frames.items()},
        foot=proposal.foot if is_ramp else None,
        is_on_ramp=is_ramp and len(things) > 1 and not proposal.doubts,
    )


def _meet(known: Understood) -> bool:
    """Whether the second thing sets out when the first is beside it."""
    if len(known.things) < 2:
        return False
    (runs, size), (struck, other_size), *_ = known.things.items()
    first, second = known.path(runs), known.path(struck)
    if first.way_px is None or second.way_px is None:
        return False
    away = np.hypot(*(second.way_px - second.way_px[:, :1])) > NEAR * max(other_size)
    both = np.intersect1d(first.frames, second.frames[away])
    if not both.size:
        return False
    one, other = (path.place(int(both[0])) for path in (first, second))
    moved = math.dist(one, first.place(int(first.frames[0]))) > max(size)
    return moved and math.dist(one, other) < max(size) + max(other_size)


def _followed(known: Understood, point: Point) -> FilmPath:
    from galileo_jax.measurement.track_cache import track_once

    item = {"name": "object1", "shape": usual_shape(""), "point_px": list(point)}
    item["first_frame"] = known.first_frame(point)
    content = {"video": known.source.name, "scenario": "flight", "objects": [item]}
    progress.report("following what moves", 0.9)
    try:
        clip = check_clip(known.yaml_path, content | {"fps": known.look.fps or USUAL_FPS})
        track = track_once(clip)
    except InputError:
        return FilmPath(None)
    seen = np.flatnonzero(track.is_visible[0])
    if len(seen) < 3:
        return FilmPath(None)
    variance = np.trace(track.covariance_px2[0], axis1=-2, axis2=-1)[seen] / 2
    path = PointPath(seen, track.times_s[seen], track.position_px[0][seen].T, variance)
    x = path.place_m[0]
    direction = "right" if goes_right(x) else "left"
    return FilmPath(_likely_between_rests(path), direction, path.place_m, path.frames)


def _likely_between_rests(path: PointPath) -> Likely:
    """The kind of motion between two rests: of the first run that is clearly one, or the longest.

    A hand that puts the thing back, or takes it away, moves it, too.
    """
    runs = runs_between(rests_of(path), len(path))
    ways = [path.place_m[:, first : last + 1] for first, last in runs]
    lengths = [float(np.hypot(*np.ptp(way, axis=1))) for way in ways]
    every = [
        likely_in_plane(*way)
        for way, length in zip(ways, lengths, strict=True)
        if way.shape[1] >= 3 and length > RUN * max(lengths)
    ]
    if len(every) < 2:
        return every[0] if every else likely_in_plane(*path.place_m)
    first = next((one for one in every if one.is_clear), likely_in_plane(*path.place_m))
    return replace(first, why=f"{first.why}; it moves {len(every)} times, with rests between")


def sentence_of(known: Clip | Understood) -> str:
    """What moves, how far and how, what it looks like, and how often it is seen."""
    if isinstance(known, Clip):
        return _of_clip(known)
    if known.look.seen is not None:
        return _of_table(known.look.seen, known.said_scenario)
    fps = known.look.fps
    rate = f" {fps:.4g} pictures a second." if fps else ""
    return f"{_of_film(known)}{rate}"


def _of_film(known: Understood) -> str:
    if known.has_objects:
        return f"{known.yaml_path.name} says where the objects are."
    if not known.points:
        return f"No moving thing was found: {known.unseen}."
    things = "One thing moves" if len(known.things) < 2 else f"{len(known.things)} things move"
    if len(known.points) > 1 and known.likely is not None:
        return f"{things}, one after the other: {_taken(known.likely, known.said_scenario)}."
    path = known.path(known.points[0])
    if path.likely is None:
        return f"{things}, but cannot be followed."
    looks = _looks(path.likely, known.said_scenario)
    which = "," if len(known.things) < 2 else "; the one that is followed goes"
    return f"{things}{which} {path.moved_px:.0f} px {looks}."


def _of_table(seen: Seen, said: str | None) -> str:
    unit = "rad" if seen.axes == ("angle",) else seen.unit or "(in a unit that it does not say)"
    who = "One thing moves" if len(seen.names) == 1 else f"{len(seen.names)} things move"
    rate = "counted in pictures" if seen.is_in_frames else f"{1 / seen.step:.3g} a second"
    looks = _looks(seen, said)
    return f"{who}, {math.hypot(*seen.moved):.3g} {unit} {looks}. {seen.num_rows} rows, {rate}."


def _looks(likely: Likely, said: str | None) -> str:
    how = next((f"{word} {likely.why}" for start, word in HOW.items()
                if likely.why.startswith(start)), f"({likely.why})")  # fmt: skip
    return f"{how}: {_taken(likely, said)}"


def _taken(likely: Likely, said: str | None) -> str:
    """What it is taken for: what a person says, or else what it looks like."""
    looks = f"it looks like {_kind(likely.scenario)}"
    if said is None or said == likely.scenario or said not in SCENARIOS:
        return looks
    return f"it is taken for {_kind(said)}, as you say; {looks}"


def _kind(scenario: str) -> str:
    article = "an" if scenario[0] in "aeiou" else "a"
    return KINDS.get(scenario, f"{article} {scenario}")


def _of_clip(clip: Clip) -> str:
    angle = clip.ramp_angle_deg
    at = f" at {angle:g} degrees" if angle is not None else ""
    names = listed([item.name for item in clip.objects])
    return f"{clip.path.name} says all that is needed: {_kind(clip.scenario)}{at}, {names}."


def listed_things(known: Understood) -> list[str]:
    """Where each thing is that moves in a film, numbered as in the picture of `write_marks`."""
    return [
        f"{n} is at {x:.0f} {y:.0f}, {width:.0f} x {height:.0f} pixels"
        + (f", from frame {first} on" if (first := known.first_frame((x, y))) else "")
        for n, ((x, y), (width, height)) in enumerate(known.things.items(), 1)
    ]


def write_marks(known: Understood, path: str | Path) -> Path:
    """Writes the first picture of a film, its things numbered in the order in which they set out.

    Of a film whose yaml names its objects these are marked. Raises `InputError` where it is no
    film, or the picture cannot be written.
    """
    if not known.is_film:
        raise InputError(f"{known.source}: a table has no picture; look(...).plot draws its places")
    from galileo_jax.video import decode  # and OpenCV, which a table does not need

    frame = next(decode.frames(known.source))[..., ::-1]
    try:
        return write_marked_picture(Path(path), frame, [*_things(known)])
    except (OSError, ValueError) as error:  # Matplotlib knows no such suffix
        raise InputError(f"{path}: {getattr(error, 'strerror', None) or error}") from error


def _things(known: Understood) -> Iterable[Marked]:
    """What is listed in the question, or what is declared."""
    for number, (point, size) in enumerate(known.things.items(), 1):
        way = known.path(point)
        slope = way.likely.slope_deg if way.likely is not None else None
        yield Marked(str(number), point, size, way.way_px, slope)
    declared = known.declared.get("objects")
    for item in declared if isinstance(declared, list) else ():
        point = item.get("point_px") if isinstance(item, dict) else None
        if isinstance(point, list) and len(point) == 2:
            yield Marked(str(item.get("name", "")), (float(point[0]), float(point[1])))
