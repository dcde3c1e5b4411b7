"""Which way a table's axes point: up, and along the line of a motion.

Gravity shows in the path: what falls bends down, what hangs sags, what slides ends lower. Of a
motion along a line one coordinate is enough; the other is then not measured, and its error is as
large as the scene (`UNMEASURED_SD_M`).
"""

import math
from dataclasses import replace
from pathlib import Path

import numpy as np

from galileo_jax.clip.plane_noise import position_noise_m, too_few_rows
from galileo_jax.clip.scenarios import SCENARIOS
from galileo_jax.clip.schema import ClipFile
from galileo_jax.observation.observation import UNMEASURED_SD_M, Observation
from galileo_jax.runtime.errors import InputError
from galileo_jax.table.track_table import TrackTable

WINDOWS, MIN_POINTS = 5, 5
MOST_SHARE = 0.6
"""Of the windows of a path that bend one way; the others are at rest, or hit something."""

ASKEW_DEG = 45.0
"""No camera is held so: what falls further from down than this falls along another axis."""

MOST_SCATTER = 0.3
"""Of gravity: what scatters more from window to window is no fall."""

MOST_OUT_OF_PLANE = 0.1


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
        value = y[0] - y[-1]
    elif shows == "sag":
        value = np.polyfit(x - x.mean(), y, 2)[0] if np.ptp(x) > 0 else 0.0
    else:
        value = -_sign(accelerations(t, y))
    return None if value == 0 else "up" if value > 0 else "down"


def _sign(values: np.ndarray) -> int:
    """That of most of the values; 0 where it is not clear."""
    if not values.size:
        return 0
    share = float((values > 0).mean())
    return 1 if share >= MOST_SHARE else -1 if share <= 1 - MOST_SHARE else 0


def in_plane(path: Path, file: ClipFile, table: TrackTable) -> tuple[TrackTable, tuple[str, ...]]:
    """The table with two axes, x and upright, in the order of `track_up`, and what was left out.

    Raises:
      InputError: it moves in space, or the axis that is declared to point up is not there.
    """
    up = file.track_up.lstrip("-")
    if up == "y" and "y" not in table.axes:
        up = "z"
    if up not in table.axes:
        raise InputError(f"{path}: track_up: {file.track_up}, but there is no column {up}")
    others = [axis for axis in table.axes if axis != up]
    if not others:
        raise InputError(f"{path}: only one coordinate, {up}")
    spread = {a: float(np.ptp(_seen(table, a))) for a in others}
    across = max(others, key=lambda axis: spread[axis])
    said: tuple[str, ...] = ()
    for axis in others:
        if axis == across:
            continue
        largest = max(spread[across], float(np.ptp(_seen(table, up))))
        if spread[axis] > MOST_OUT_OF_PLANE * largest:
            raise InputError(
                f"{path}: moves by {spread[axis]:g} along {axis} and by {spread[across]:g} along "
                f"{across}: in space; titles time_s, x_m, y_m, z_m in metres expected for that"
            )
        said += (f"{path}: {axis} is not used: the motion is in the plane of {across} and {up}",)
    chosen = [table.axes.index(across), table.axes.index(up)]
    position = table.position[:, chosen]
    if up == "x":  # a quarter turn, so that the other axis becomes the level one
        position = position * ([[1.0], [-1.0]] if file.track_up == "-x" else [[-1.0], [1.0]])
    y_axis = "up" if up != "y" else table.y_axis
    resolution = tuple(table.resolution[n] for n in chosen) if table.resolution else ()
    return replace(table, position=position, resolution=resolution, y_axis=y_axis), said


def _seen(table: TrackTable, axis: str) -> np.ndarray:
    values = table.position[0, table.axes.index(axis)]
    seen = values[np.isfinite(values)]
    return seen if seen.size else np.zeros(1)


def along_line(
    yaml_path: Path,
    path: Path,
    file: ClipFile,
    axis: str,
    times: np.ndarray,
    way_m: np.ndarray,
    rounding_m: float,
) -> Observation:
    """One coordinate `[object, row]`, m, as a motion along the scenario's line.

    Raises:
      InputError: the scenario's motion is along no line, or its slope is not known.
    """
    scenario = SCENARIOS[file.scenario]
    if scenario.line is None:
        raise InputError(
            f"{path}: only one coordinate ({axis}), but scenario {file.scenario} "
            f"({scenario.meaning}) needs x and y; along a line are "
            f"{', '.join(name for name, one in SCENARIOS.items() if one.line)}"
        )
    if scenario.line == "slope" and file.ramp_angle_deg is None:
        raise InputError(
            f"{yaml_path}: ramp_angle_deg: null, but {path.name} has the way alone; an angle in "
            "degrees expected"
        )
    sds = []
    for index, item in enumerate(file.objects):
        sd = position_noise_m(times, way_m[index])
        if math.isnan(sd):
            raise too_few_rows(path, item.name)
        sds.append(max(sd, rounding_m / math.sqrt(12)))
    names = tuple(item.name for item in file.objects)
    sd_m = np.repeat(np.array(sds)[:, None], len(times), axis=1)
    is_upright = scenario.line == "down" and axis in ("y", "z")
    if is_upright and file.track_y is not None:
        sign = 1 if file.track_y == "up" else -1
    else:
        sign = sign_along(file, times, way_m[0])
    return line_observation(file, names, times, sign * way_m, sd_m)


def sign_along(file: ClipFile, times: np.ndarray, way: np.ndarray) -> int:
    """1 or -1: by which a way `[row]` counts down the slope, along the level, or up."""
    seen = np.isfinite(way)
    scenario = SCENARIOS[file.scenario]
    if scenario.line == "down":
        sign = -_sign(accelerations(times[seen], way[seen])) if scenario.up_shows else 1
        return sign or 1
    gone = way[seen] - way[seen][0]
    has_turned = abs(gone[-1]) < 0.5 * np.abs(gone).max()
    return (_sign(accelerations(times[seen], gone)) if has_turned else int(np.sign(gone[-1]))) or 1


def line_observation(
    file: ClipFile, names: tuple[str, ...], times: np.ndarray, way: np.ndarray, sd_m: np.ndarray
) -> Observation:
    """Ways `[object, row]`, m, along the scenario's line; across it nothing is known."""
    scenario = SCENARIOS[file.scenario]
    angle = math.radians(file.ramp_angle_deg or 0.0) if scenario.line == "slope" else 0.0
    along = np.array([math.cos(angle), -math.sin(angle)])
    if scenario.line == "down":
        along = np.array([0.0, 1.0])
    across = np.array([-along[1], along[0]])
    lifted = [_half_height(item.shape, item.size_m) for item in file.objects]
    height = np.array(lifted)[:, None] if scenario.line == "slope" else np.zeros((len(names), 1))
    place = np.einsum("a,ot->oat", along, way) + np.einsum("a,ot->oat", across, height + 0 * way)
    covariance = np.einsum("a,b,ot->oabt", along, along, sd_m**2)
    covariance += (np.outer(across, across) * UNMEASURED_SD_M**2)[None, :, :, None]
    mask = np.isfinite(way)
    covariance = np.where(mask[:, None, None], covariance, np.nan)
    return Observation(names, times, np.where(mask[:, None], place, np.nan), covariance, mask)


def _half_height(shape: str, size_m: tuple[float, ...] | None) -> float:
    if size_m is None:
        return 0.0
    return size_m[2] / 2 if shape == "box" else sum(size_m) if shape == "torus" else size_m[0]


def swung(
    yaml_path: Path, path: Path, file: ClipFile, times: np.ndarray, angle_rad: np.ndarray
) -> Observation:
    """Angles `[object, row]` of a pendulum from the vertical, as places on its circle.

    Raises:
      InputError: the thread is not declared, or nothing hangs on one.
    """
    if file.thread_m is None:
        where = "" if "thread_m" in SCENARIOS[file.scenario].keys else ": only a pendulum's"
        raise InputError(
            f"{yaml_path}: thread_m: missing; {path.name} has an angle alone{where}; write "
            "thread_m: and its length in metres"
        )
    place = file.thread_m * np.stack([np.sin(angle_rad), -np.cos(angle_rad)], axis=1)
    covariance = np.full((len(place), 2, 2, len(times)), np.nan)
    for index, item in enumerate(file.objects):
        sd = position_noise_m(times, file.thread_m * angle_rad[index])
        if math.isnan(sd):
            raise too_few_rows(path, item.name)
        covariance[index] = (np.eye(2) * sd**2)[:, :, None]
    mask = np.isfinite(angle_rad)
    covariance = np.where(mask[:, None, None], covariance, np.nan)
    return Observation(tuple(i.name for i in file.objects), times, place, covariance, mask)


def check_falls_down(yaml_path: Path, path: Path, file: ClipFile, observation: Observation) -> None:
    """Raises `InputError` where what falls or flies does so along another axis than down."""
    if SCENARIOS[file.scenario].up_shows != "bend" or observation.position_m.shape[1] != 2:
        return
    seen = observation.mask[0]
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
        side = "+x" if x > 0 else "-x"
        up = "-x" if x > 0 else "x"
        raise InputError(
            f"{yaml_path}: {path.name} falls along {side}, {angle:.0f} degrees from down; write "
            f"track_up: {up}"
        )
    if _sign(by_axis[1]) > 0:
        raise InputError(
            f"{yaml_path}: {path.name} falls up; write track_y: "
            f"{'down' if file.track_y != 'down' else 'up'}"
        )
