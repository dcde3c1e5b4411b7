"""Which way a table's axes point: up, and along the line of a motion.

Gravity shows in the path: what falls bends down, what hangs sags, what slides ends lower. Of a
motion along a line one coordinate is enough; the other is then not measured, and its error is as
large as the scene (`UNMEASURED_SD_M`).
"""

import math
from dataclasses import replace

import numpy as np

from galileo_jax.clip.declared_track import DeclaredTrack
from galileo_jax.clip.scenarios import SCENARIOS
from galileo_jax.clip.schema import ClipFile
from galileo_jax.clip.track_noise import told_noise_m
from galileo_jax.numerics.least_squares import circle, line_through
from galileo_jax.observation.observation import UNMEASURED_SD_M, Observation
from galileo_jax.runtime.errors import named
from galileo_jax.table.track_table import TrackTable

WINDOWS, MIN_POINTS = 5, 5
BACK = 0.1  # of its way: what comes back by less has not turned
MOST_SHARE = 0.6
"""Of the windows of a path that bend one way; the others are at rest, or hit something."""

ASKEW_DEG = 45.0
"""No camera is held so: what falls further from down than this falls along another axis."""

MOST_SCATTER = 0.3  # of gravity: what scatters more from window to window is no fall
MOST_OUT_OF_PLANE = 0.1
LESS_THAN_ROUND = 1 / 3  # of its radius: the middle of what goes all round is nearer to the pivot


def _turned_level(table: TrackTable, across: str, aside: str) -> tuple[TrackTable, float]:
    """The table turned about the upright so that object 1 goes along one axis, and by how much.

    As it is, and 0 degrees, where it goes along that axis, or along no straight line.
    """
    level = [table.axes.index(across), table.axes.index(aside)]
    points = table.position[0, level]
    points = points[:, np.isfinite(points).all(axis=0)]
    if points.shape[1] < MIN_POINTS or np.ptp(points[1]) <= MOST_OUT_OF_PLANE * np.ptp(points[0]):
        return table, 0.0
    line = line_through(points)
    if np.ptp(line.across @ points) > MOST_OUT_OF_PLANE * np.ptp(line.along @ points):
        return table, 0.0
    position = table.position.copy()
    turn = np.stack([line.along, line.across])
    position[:, level] = np.einsum("ab,obt->oat", turn, table.position[:, level])
    return replace(table, position=position), math.degrees(math.atan2(*line.along[::-1]))


def observed_where_finite(
    names: tuple[str, ...],
    times_s: np.ndarray,
    position_m: np.ndarray,
    covariance_m2: np.ndarray,
    is_turning: bool = False,
) -> Observation:
    """Objects that are seen in the rows in which they have a place; NaN in the others."""
    mask = np.asarray(np.isfinite(position_m).all(axis=1))
    place = np.where(mask[:, None], position_m, np.nan)
    covariance = np.where(mask[:, None, None], covariance_m2, np.nan)
    return Observation(names, times_s, place, covariance, mask, is_turning=is_turning)


def accelerations(times_s: np.ndarray, values: np.ndarray) -> np.ndarray:
    """The accelerations `[window]` of parabolas through overlapping windows; may be none."""
    size = max(MIN_POINTS, len(times_s) // WINDOWS)
    found = [
        2 * np.polyfit(times_s[i : i + size] - times_s[i], values[i : i + size], 2)[0]
        for i in range(0, len(times_s) - size + 1, max(1, size // 2))
    ]
    return np.array(found)


def up_from_motion(shows: str, times: np.ndarray, place: np.ndarray) -> str | None:
    """Which way the y axis of `place` `[2, row]` points, "up" or "down"; None: it does not show."""
    seen = np.isfinite(place).all(axis=0)
    t, (x, y) = times[seen], place[:, seen]
    if shows == "drop":
        top = int(np.argmax(abs(y - y[0])))
        start, highest, end = place[:, seen][:, [0, top, -1]].T
        gone, back = highest - start, end - highest
        comes_back = (back * gone < -BACK * gone**2).all()
        value = _against_pull(t[: top + 1], y[: top + 1]) if comes_back else start[1] - end[1]
    elif shows == "sink":
        value = y[0] - y[-1]
    elif shows == "sag":
        value = np.polyfit(x - x.mean(), y, 2)[0] if np.ptp(x) > 0 else 0.0
    else:
        value = -_sign(accelerations(t, y))
        has_turned = np.ptp(y) > (1 + BACK) * abs(y[-1] - y[0])
        if value == 0 and not has_turned:  # it falls no faster in the end
            value = y[0] - y[-1]
    return None if value == 0 else "up" if value > 0 else "down"


def goes_right(x: np.ndarray) -> bool:
    """Whether the place farthest from the first of `x` `[row]` lies to its right."""
    return bool(x[np.argmax(np.abs(x - x[0]))] >= x[0])


def _against_pull(times: np.ndarray, place: np.ndarray) -> float:
    """Which way is up for what went this way and came back, in the sign.

    What was pushed up slows down on its way; what slid down speeds up, and a hand carries it back.
    """
    gone = np.abs(place - place[0]) / abs(place[-1] - place[0])
    # Without the push, and the rest at the end.
    way = slice(int(np.argmax(gone > BACK)), int(np.argmax(gone > 1 - BACK)))
    if way.stop - way.start < MIN_POINTS:
        return float(place[-1] - place[0])
    return -float(np.polyfit(times[way] - times[way.start], place[way], 2)[0])


def _sign(values: np.ndarray) -> int:
    """That of most of the values that are not far below the usual one; 0 where it is not clear.

    What rests, or what a track has leapt to, adds values about 0.
    """
    if not values.size:
        return 0
    values = values[np.abs(values) >= 0.5 * np.median(np.abs(values))]
    share = float((values > 0).mean())
    return 1 if share >= MOST_SHARE else -1 if share <= 1 - MOST_SHARE else 0


def in_plane(of: DeclaredTrack, table: TrackTable) -> tuple[TrackTable, tuple[str, ...]]:
    """The table with two axes, x and upright, in the order of `track_up`, and what was left out.

    Raises:
      InputError: it moves in space, or the axis that is declared to point up is not there.
    """
    declared = of.file.track_up
    up = declared.lstrip("-")
    if up == "y" and "y" not in table.axes:
        up = "z"
    if up not in table.axes:
        raise of.wrong(f"track_up: {declared}, but there is no column {up}")
    others = [axis for axis in table.axes if axis != up]
    if not others:
        raise of.wrong(f"only one coordinate, {up}")
    finite = [one[np.isfinite(one)] for one in table.position[0]]
    spread = {axis: float(np.ptp(one)) if one.size else 0.0
              for axis, one in zip(table.axes, finite, strict=True)}  # fmt: skip
    said: tuple[str, ...] = ()
    is_flat = "z" in others and spread["y"] < MOST_OUT_OF_PLANE * min(spread["x"], spread["z"])
    is_upright = not of.scenario.is_level and of.scenario.angle_deg != 0
    if up == "y" and is_flat and is_upright:
        up, others = "z", ["x", "y"]
        said = (f"{of.path}: z is taken as up, for it does not move along y (`track_up`)",)
    across = max(others, key=lambda axis: spread[axis])
    if is_upright and (aside := [axis for axis in others if axis != across]):
        table, turned_deg = _turned_level(table, across, aside[0])
        if turned_deg:
            said += (f"{of.path}: the motion is in a plane {turned_deg:.0f} degrees from {across} "
                     f"to {aside[0]}; ways are along that",)  # fmt: skip
            spread[aside[0]] = 0.0
    for axis in others:
        if axis == across:
            continue
        if spread[axis] > MOST_OUT_OF_PLANE * max(spread[across], spread[up]):
            raise of.wrong(
                f"moves by {spread[axis]:g} along {axis} and by {spread[across]:g} along "
                f"{across}: in space; titles time_s, x_m, y_m, z_m in metres expected for that"
            )
        said += (f"{of.path}: {axis} is not used: the motion is in the plane of {across} and {up}",)
    chosen = [table.axes.index(across), table.axes.index(up)]
    position = table.position[:, chosen]
    if up == "x":  # a quarter turn, so that the other axis becomes the level one
        position = position * ([[1.0], [-1.0]] if declared == "-x" else [[-1.0], [1.0]])
    y_axis = "up" if up != "y" else table.y_axis
    resolution = tuple(table.resolution[n] for n in chosen) if table.resolution else ()
    return replace(table, position=position, resolution=resolution, y_axis=y_axis), said


def along_line(
    of: DeclaredTrack, table: TrackTable, times: np.ndarray, way_m: np.ndarray, rounding_m: float
) -> tuple[Observation, tuple[str, ...]]:
    """The one coordinate of a table, `[object, row]`, m, as a motion along the scenario's line.

    Of what goes down a slope y alone is the height if it falls, or if its title or `track_y` says
    so. Returns what is said of that, too.

    Raises:
      InputError: the scenario's motion is along no line, or its slope is not known.
    """
    scenario, file, axis, y_axis = of.scenario, of.file, table.axes[0], table.y_axis
    if scenario.line is None:
        raise of.wrong(
            f"only one coordinate ({axis}), but scenario {file.scenario} "
            f"({scenario.meaning}) needs x and y; along a line are "
            f"{', '.join(name for name, one in SCENARIOS.items() if one.line)}"
        )
    if scenario.line == "slope" and file.ramp_angle_deg is None:
        raise of.wrong_key(
            f"ramp_angle_deg: null, but {of.path.name} has the way alone; an angle in "
            "degrees expected"
        )
    with named(of.path):
        told = [told_noise_m(name, times, w) for name, w in zip(of.names, way_m, strict=True)]
    sd_m = np.maximum(told, rounding_m / math.sqrt(12))[:, None] + np.zeros(len(times))
    if scenario.line == "down" and file.track_y is not None:
        sign = 1 if file.track_y == "up" else -1
    else:
        sign = sign_along(file, times, way_m[0])
        seen = way_m[0][np.isfinite(way_m[0])]
        if scenario.up_shows == "sink" and y_axis is not None:
            sign = 1 if y_axis == "up" else -1
        elif scenario.up_shows == "sink" and seen[-1] > seen[0]:
            raise of.wrong_key(rises_or_sinks(of, "the way" if axis == "line" else axis))
    said: tuple[str, ...] = ()
    if scenario.line == "slope" and axis != "line":
        is_height = axis == "y" and (sign < 0 or (file.track_y or y_axis) is not None)
        what = "the height" if is_height else "the way down the slope"
        said = (f"{of.path}: {axis} alone is taken for {what}",)
        steepness = math.sin(math.radians(file.ramp_angle_deg or 0.0)) if is_height else 1.0
        if steepness <= 0:
            raise of.wrong_key("ramp_angle_deg: 0, where a height alone tells no way; x expected")
        way_m, sd_m = way_m / steepness, sd_m / steepness
    on_line = line_observation(file, of.names, times, sign * way_m, sd_m)
    return replace(on_line, rows_of_noise=len(times)), said


def rises_or_sinks(of: DeclaredTrack, axis: str, usual: str = "up") -> str:
    """The question of what a liquid's motion does not show; `usual`: which way the axis points."""
    return (
        f"track_y: missing; in {of.path.name} it rises if {axis} points {usual}, and sinks if not "
        "(a depth points down); write track_y: up | down"
    )


def sign_along(file: ClipFile, times: np.ndarray, way: np.ndarray) -> int:
    """1 or -1: by which a way `[row]` counts down the slope, along the level, or up."""
    seen = np.isfinite(way)
    scenario = SCENARIOS[file.scenario]
    if scenario.line == "down":
        if scenario.up_shows != "bend":
            return 1
        # Between bounces it falls in most rows, though not in most parabolas.
        falls = np.diff(way[seen], 2) if file.has_floor else accelerations(times[seen], way[seen])
        return -_sign(falls) or 1
    gone = way[seen] - way[seen][0]
    has_turned = abs(gone[-1]) < 0.5 * np.abs(gone).max()
    return (_sign(accelerations(times[seen], gone)) if has_turned else int(np.sign(gone[-1]))) or 1


def line_observation(
    file: ClipFile, names: tuple[str, ...], times: np.ndarray, way: np.ndarray, sd_m: np.ndarray
) -> Observation:
    """Ways `[object, row]`, m, along the scenario's line; across it nothing is known."""
    line = SCENARIOS[file.scenario].line
    angle = math.radians(file.ramp_angle_deg or 0.0) if line == "slope" else 0.0
    along = np.array([math.cos(angle), -math.sin(angle)] if line != "down" else [0.0, 1.0])
    across = np.array([-along[1], along[0]])
    height = np.array([_half_height(item.shape, item.size_m) for item in file.objects])
    place = along[:, None] * way[:, None]
    if line == "slope":
        place = place + across[:, None] * height[:, None, None]
    covariance = np.einsum("a,b,ot->oabt", along, along, sd_m**2)
    covariance += (np.outer(across, across) * UNMEASURED_SD_M**2)[None, :, :, None]
    return observed_where_finite(names, times, place, covariance)


def _half_height(shape: str, size_m: tuple[float, ...] | None) -> float:
    if size_m is None:
        return 0.0
    return size_m[2] / 2 if shape == "box" else sum(size_m) if shape == "torus" else size_m[0]


def swung(of: DeclaredTrack, times: np.ndarray, angle_rad: np.ndarray) -> Observation:
    """Angles `[object, row]` of a pendulum from the vertical, as places on its circle.

    Raises:
      InputError: the thread is not declared, or nothing hangs on one.
    """
    thread_m = of.file.thread_m
    if thread_m is None:
        where = "" if "thread_m" in of.scenario.keys else ": only a pendulum's"
        raise of.wrong_key(
            f"thread_m: missing; {of.path.name} has an angle alone{where}; write "
            "thread_m: and its length in metres"
        )
    place = thread_m * np.stack([np.sin(angle_rad), -np.cos(angle_rad)], axis=1)
    with named(of.path):
        sd = np.array([told_noise_m(name, times, thread_m * one)
                       for name, one in zip(of.names, angle_rad, strict=True)])  # fmt: skip
    covariance = sd[:, None, None, None] ** 2 * np.eye(2)[:, :, None]
    on_circle = observed_where_finite(of.names, times, place, covariance)
    return replace(on_circle, rows_of_noise=len(times))


def check_falls_down(of: DeclaredTrack, observation: Observation) -> None:
    """Raises `InputError` where what falls, flies or hangs does so along another axis than down."""
    if observation.position_m.shape[1] != 2:
        return
    seen = observation.mask[0]
    if of.scenario.up_shows == "sag" and seen.sum() > MIN_POINTS:
        _check_hangs_down(of, observation.position_m[0][:, seen])
    if of.scenario.up_shows != "bend":
        return
    times = observation.times_s[seen]
    by_axis = [accelerations(times, one) for one in observation.position_m[0][:, seen]]
    x, y = (float(np.median(one)) if one.size else 0.0 for one in by_axis)
    angle = math.degrees(math.atan2(abs(x), -y))
    if angle <= ASKEW_DEG:
        return
    if abs(x) > abs(y):
        scatter = float(np.median(np.abs(by_axis[0] - x)))
        speeds = np.gradient(observation.position_m[0, 0][seen], times)
        ends = float(np.median(speeds[-MIN_POINTS:])) * math.copysign(1.0, x)
        # What slows down along x is braked; what falls ends as fast as it ever was.
        if scatter > MOST_SCATTER * abs(x) or ends < 0.3 * np.abs(speeds).max():
            return
        side, up = ("+x", "-x") if x > 0 else ("-x", "x")
        raise of.wrong_key(
            f"{of.path.name} falls along {side}, {angle:.0f} degrees from down; write "
            f"track_up: {up}"
        )
    if _sign(by_axis[1]) > 0:
        other = "down" if of.file.track_y != "down" else "up"
        raise of.wrong_key(f"{of.path.name} falls up; write track_y: {other}")


def _check_hangs_down(of: DeclaredTrack, place_m: np.ndarray) -> None:
    """Raises `InputError` where the pivot of an arc `[2, row]` lies aside of it, not above."""
    arc = circle(*place_m)
    x, y = place_m.mean(axis=1) - arc.centre
    is_arc = math.hypot(x, y) > LESS_THAN_ROUND * arc.radius
    if arc.is_told and is_arc and abs(x) > abs(y):
        side, up = ("+x", "-x") if x > 0 else ("-x", "x")
        raise of.wrong_key(
            f"{of.path.name} is an arc that hangs along {side}; are x and y swapped? write "
            f"track_up: {up}"
        )
