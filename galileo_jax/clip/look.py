"""What a table shows before anything is declared: its columns, its time, what moves and how."""

import math
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from galileo_jax.clip.fields import short
from galileo_jax.clip.track_axes import accelerations
from galileo_jax.clip.track_csv import MIN_ROWS
from galileo_jax.numerics.least_squares import line_through, polynomial, two_lines
from galileo_jax.runtime.errors import InputError
from galileo_jax.table.clock import usual_step
from galileo_jax.table.track_table import METRES_PER_UNIT, Column, TrackTable

STRAIGHT = 0.03  # of a path's length: what stays within this of a line is straight
LEVEL_DEG, STEEP_DEG = 2.0, 60.0
"""Between these a straight way is a slope; a steeper one may be a table seen from above."""

SETS_OUT = 0.05  # of the longest way of all bodies: who is so far away has set out
SWINGS = 3  # turns back of a motion that swings
FEWEST_ON_A_LINE, ENOUGH_PLACES = 4, 200
"""Places that tell how straight a piece of a path is; of a whole path more are not looked at."""

HALF = 0.5  # of its range: what bounces at the end of its way comes back by less each time
PER_TURN, STILL, SAME_SIGN = 8, 0.1, 0.7
"""Places between two turns that show how they are bent; bends smaller by so much are none; which
share of them has the same sign where something bounces: half do where it swings."""

MIN_NEIGHBOURS, STRAY, MANY = 8, 0.05, 10.0
"""Places at least; a place that was marked wrongly is off its neighbours by more than this share of
the way, and by so many times as much as the others."""

FALL_M_S2 = (7.0, 12.0)  # what a fall accelerates with, air and a camera that is not level in it
JITTERS, ROWS_OF_A_STEP = 0.6, 8
GAP = 1.5  # of the usual step


@dataclass(frozen=True)
class Likely:
    """The likeliest kind of motion of a path."""

    scenario: str  # its name
    why: str  # what speaks for it, one phrase
    is_clear: bool = False  # no other kind of motion looks like it
    # of a straight path in two coordinates, against the horizontal; None of others
    slope_deg: float | None = None
    # how often it turns back by more than half of its way, as nothing does that slides
    swings: int = 0
    # whether it comes back up from something below, which a yaml calls `floor`
    bounces: bool = False

    @property
    def is_throw(self) -> bool:
        """Whether it is a throw, and nothing else looks like it."""
        return self.is_clear and self.scenario == "flight"


AT_REST = Likely("incline", "nothing moves but by the errors of its places")


@dataclass(frozen=True, kw_only=True)
class Seen(Likely):
    """What was understood of a table, and of object 1 in it."""

    path: Path  # the file
    columns: tuple[Column, ...]  # role, unit and resolution of each
    names: tuple[str, ...]  # of the objects
    num_rows: int  # of the table
    step: float  # the usual time between rows, s, or in frames where it has no times
    is_in_frames: bool  # the file counts frames; `fps` makes them seconds
    gaps: tuple[tuple[int, float], ...]  # (row, how many steps long) of the longer ones, from 0
    unit: str | None  # of length; None where the file does not say
    axes: tuple[str, ...]  # that were measured
    moved: tuple[float, ...]  # how far object 1 moves along each axis, in the file's unit
    yaml: str  # that would be written beside the file
    warnings: tuple[str, ...] = ()  # doubts, one line each


def seen_in_table(path: Path, table: TrackTable, fps: float | None = None) -> Seen:
    """What a table shows; `fps` makes its frames seconds.

    Raises:
      InputError: too few rows show a place.
    """
    warnings = table.warnings
    if (count := len(table.starts)) > 1:
        warnings += (f"{path}: {count} motions, of which the first is looked at",)
        table = table.motion(1)
    steps, step = np.diff(table.clock), usual_step(table.clock)
    place = table.position[0]
    shown = np.isfinite(place).all(axis=0)
    if (num := int(shown.sum())) < MIN_ROWS:
        raise InputError(f"{path}: {num} rows show a place; at least {MIN_ROWS} expected")
    likely = _likely(table, table.seconds(fps)[shown], place[:, shown])
    return Seen(
        **vars(likely),
        path=path,
        columns=table.columns,
        names=table.names,
        num_rows=table.position.shape[-1],
        step=step,
        is_in_frames=table.is_in_frames,
        gaps=tuple((int(n), float(steps[n] / step)) for n in np.flatnonzero(steps > GAP * step)),
        unit=table.unit,
        axes=table.axes,
        moved=tuple(float(np.ptp(one[shown])) if shown.any() else 0.0 for one in place),
        yaml=proposed_yaml(path, table, likely.scenario, fps, count, likely.bounces),
        warnings=warnings,
    )


def _likely(table: TrackTable, seconds: np.ndarray, place: np.ndarray) -> Likely:
    """The likeliest scenario of object 1's path."""
    metres_per_unit = METRES_PER_UNIT.get(table.unit or "", math.nan)
    if len(table.names) > 1:
        why = f"{len(table.names)} objects; a ramp, if one slides down into others"
        return Likely("from_above", why)
    if table.axes == ("angle",):
        return Likely("pendulum", "an angle in time", is_clear=True)
    if _jitters(place):
        return AT_REST
    if len(place) == 1:
        return _along_a_line(seconds, place[0], metres_per_unit, table.axes == ("y",))
    found = likely_in_plane(place[0], place[1])
    if found.scenario == "level":  # a table's x may lie along a slope, as a picture's does not
        return replace(found, scenario="incline")
    if found.scenario != "fall":
        return found
    size = abs(_acceleration(seconds, place[1]) * metres_per_unit)
    if not math.isfinite(size) or FALL_M_S2[0] < size < FALL_M_S2[1]:
        return found
    return replace(found, is_clear=False, why=f"{found.why}, {size:.3g} m/s^2")


def _along_a_line(
    seconds: np.ndarray, way: np.ndarray, metres_per_unit: float, is_height: bool
) -> Likely:
    """The likeliest scenario of one coordinate in time; `is_height`: its title says so."""
    if _bounces(way):
        return Likely("fall", "one coordinate, which is thrown back", bounces=True)
    if (turns := len(_turning(way))) >= SWINGS:
        why = f"one coordinate, which turns back {turns} times"
        return Likely("spring", why, swings=len(_turning(way, HALF)))
    size = _acceleration(seconds, way) * metres_per_unit
    if math.isfinite(size) and FALL_M_S2[0] < abs(size) < FALL_M_S2[1]:
        why = f"one coordinate, {short(round(abs(size), 2))} m/s^2"
        return Likely("fall", why, is_clear=True)
    told = f", {abs(size):.3g} m/s^2" if math.isfinite(size) else ""
    return (
        Likely("fall", f"a height{told}")
        if is_height
        else Likely("incline", f"one coordinate{told}")
    )


def _without_strays(values: np.ndarray) -> np.ndarray:
    """A coordinate in which single places that lie far off their neighbours are as these are."""
    if len(values) < MIN_NEIGHBOURS:
        return values
    beside = np.median([values[:-2], values[1:-1], values[2:]], axis=0)
    off = np.abs(values[1:-1] - beside)
    is_stray = off > np.maximum(STRAY * np.ptp(values), MANY * np.median(off))
    return np.concatenate([values[:1], np.where(is_stray, beside, values[1:-1]), values[-1:]])


def likely_in_plane(x: np.ndarray, y: np.ndarray) -> Likely:
    """The likeliest scenario of one object's path in a plane, in any unit and without a clock."""
    if _jitters(np.stack([x, y])):
        return AT_REST
    x, y = _without_strays(x), _without_strays(y)
    along = x if np.ptp(x) >= np.ptp(y) else y
    turns = len(_turning(along))
    straight, degrees = _straight(x, y)
    if straight and degrees > 90 - LEVEL_DEG and _bounces(along):
        why = "a straight way up and down, thrown back below"
        return Likely("fall", why, is_clear=True, slope_deg=degrees, bounces=True)
    if turns >= SWINGS:
        kind = "spring" if straight else "pendulum"
        return Likely(kind, f"turns back {turns} times", swings=len(_turning(along, HALF)))
    if not straight:
        if (ramp := _ramp(x, y)) is not None:
            return ramp
        is_thrown = np.ptp(_beside_parabola(x, y)) <= STRAIGHT * np.hypot(np.ptp(x), np.ptp(y))
        return Likely("flight", "a path that bends", is_clear=bool(is_thrown))
    if degrees > 90 - LEVEL_DEG:
        return Likely("fall", "a straight way up or down", is_clear=True, slope_deg=degrees)
    why = f"a straight way at {degrees:.2f} degrees"
    if degrees <= LEVEL_DEG:
        return Likely("level", why, slope_deg=degrees)
    is_slope = degrees < STEEP_DEG
    return Likely("incline", why, is_clear=is_slope, slope_deg=degrees)


def _ramp(x: np.ndarray, y: np.ndarray) -> Likely | None:
    """A slope and then a level; None of a path that is no such two lines, or rather a parabola.

    `x`, `y`: in the order of time.
    """
    some = slice(None, None, len(x) // ENOUGH_PLACES + 1)
    x, y = x[some], y[some]
    points, size = np.stack([x, y]), float(np.hypot(np.ptp(x), np.ptp(y)))
    found = two_lines(points, FEWEST_ON_A_LINE)
    if found is None:
        return None
    *lines, at = found
    parts = np.split(points, [at], axis=1)
    each = zip(lines, parts, strict=True)
    left = np.concatenate([one.across @ (part - one.middle[:, None]) for one, part in each])
    if np.ptp(left) > STRAIGHT * size or np.sum(left**2) > np.sum(_beside_parabola(x, y) ** 2):
        return None
    slope, level = (_straight(*part)[1] for part in parts)
    if not 2 * level < slope < STEEP_DEG:
        return None
    why = f"a path that falls by {slope:.0f} degrees and then is level"
    return Likely("ramp", why, is_clear=True)


def _beside_parabola(x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """How far a path is above the parabola over x, as of what is thrown, that fits it best."""
    return polynomial(x - x.mean(), y, 2).left


def _turning(values: np.ndarray, share: float = 0.1) -> list[int]:
    """Where a coordinate turns back, by more than a share of its range."""
    least = share * float(np.ptp(values))
    turns, last, direction = [], 0, 0
    for i, value in enumerate(values):
        beyond = value - values[last]
        if direction == 0 and abs(beyond) > least:
            direction, last = (1 if beyond > 0 else -1), i
        elif direction and beyond * direction > 0:
            last = i
        elif direction and -beyond * direction > least:
            turns.append(last)
            direction, last = -direction, i
    return turns


def _jitters(place: np.ndarray) -> bool:
    """Whether places `[axis, row]` are errors about one place, each for itself.

    Von Neumann's ratio, the mean square of the steps over the variance, is 2 of such, over however
    many rows a step is. What swings comes back in some of them.
    """
    if place.shape[1] < 3 * ROWS_OF_A_STEP:
        return False
    spread = np.var(place, axis=1)
    apart = [place[:, n:] - place[:, :-n] for n in range(1, ROWS_OF_A_STEP + 1)]
    least = np.min([np.mean(one**2, axis=1) for one in apart], axis=0)
    return bool((least > JITTERS * spread)[spread > 0].all())


def _bounces(along: np.ndarray) -> bool:
    """Whether a coordinate at even times turns back gently on one side and suddenly on the other.

    What swings is accelerated one way as long as the other; what bounces is all the time but for
    blows.
    """
    turns = _turning(along)
    if len(turns) < 2:
        return False
    between = (turns[-1] - turns[0]) / (len(turns) - 1)
    moved = along[: turns[-1] + round(between) : max(round(between / PER_TURN), 1)]
    bend = np.diff(moved, 2)
    bend = bend[np.abs(bend) > STILL * float(np.ptp(along)) / PER_TURN**2]
    return bool(len(bend) >= SWINGS and abs(np.mean(bend > 0) - HALF) > SAME_SIGN - HALF)


def _straight(x: np.ndarray, y: np.ndarray) -> tuple[bool, float]:
    """(whether a path is straight, its angle against the horizontal, degrees)."""
    points = np.stack([x, y])
    line = line_through(points)
    is_straight = np.ptp(line.across @ points) <= STRAIGHT * np.ptp(line.along @ points)
    return bool(is_straight), math.degrees(math.atan2(*np.abs(line.along[::-1])))


def _acceleration(seconds: np.ndarray, values: np.ndarray) -> float:
    if not np.isfinite(seconds).all():
        return math.nan
    found = accelerations(seconds, values)
    return float(np.median(found)) if found.size else math.nan


def proposed_yaml(
    path: Path, table: TrackTable, scenario: str, fps: float | None, motions: int, has_floor: bool
) -> str:
    """The clip's yaml; what nobody can know but the user is a comment.

    `table`: the motion that is looked at, of so many `motions` in the file.
    """
    place = table.position[0]
    place = place[:, np.isfinite(place).all(axis=0)]
    lines = [f"track: {path.name}", f"scenario: {scenario}"]
    if motions > 1:
        lines.append(f"trial: 1  # of {motions}: one clip for each")
    if has_floor:
        lines.append("floor: true")
    if table.is_in_frames:
        lines.append(f"fps: {fps:g}" if fps else "# fps: of the camera, frames per second")
    if table.unit is None:
        lines.append("# track_units: m | cm | mm | km | in | ft | px; the file does not say")
    if table.unit == "px":
        lines.append("# pixels_per_metre: where it is known")
    if scenario == "incline":
        degrees = _straight(*place[:2])[1] if len(place) > 1 and place.shape[1] > 1 else 0.0
        seen = f"; the path lies at {degrees:.1f}" if degrees > LEVEL_DEG else ""
        lines.append(f"# ramp_angle_deg: measured, in degrees{seen}")
    shape = usual_shape(scenario)
    lines.append("objects:")
    for name in _by_onset(table):
        plain = "".join(c if c.isalnum() and c.isascii() else "_" for c in name).strip("_")
        plain = plain if plain[:1].isalpha() else f"object{table.names.index(name) + 1}"
        track_name = f", track_name: '{name}'" if len(table.names) > 1 else ""
        lines.append(f"  - {{name: {plain}, shape: {shape}{track_name}}}")
    return "\n".join(lines) + "\n"


def _by_onset(table: TrackTable) -> list[str]:
    """The names of its bodies, those first that set out first; last those that never do."""
    begins = np.where(np.isfinite(table.position), table.position, np.inf)
    seen = np.isfinite(begins).all(axis=1).argmax(axis=1)
    first = np.take_along_axis(table.position, seen[:, None, None], axis=-1)
    gone = np.nan_to_num(np.linalg.norm(table.position - first, axis=1))
    away = gone > SETS_OUT * gone.max()
    onset = np.where(away.any(axis=1), away.argmax(axis=1), away.shape[1])
    return [table.names[i] for i in np.argsort(onset, kind="stable")]


def usual_shape(scenario: str) -> str:
    """The shape that most bodies have in such a motion."""
    return {"fall": "sphere", "flight": "sphere", "from_above": "cylinder"}.get(scenario, "box")
