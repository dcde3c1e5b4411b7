"""Poses of one body as csv: `time_s, x_m, y_m, z_m, qw, qx, qy, qz`.

Each title may begin with the object's name (`object1_x_m`, `object1_qw`). The quaternion's real
part comes first; it turns the body's axes, which are along its edges, into the track's. Lengths are
in metres, times in seconds.
"""

from pathlib import Path

import numpy as np

from galileo_jax.clip.track_csv import MAX_POSITION_M, TIME, check_times
from galileo_jax.observation.poses import Poses
from galileo_jax.runtime.errors import InputError, named
from galileo_jax.table.grid import read_cells
from galileo_jax.table.numbers import values_of

PLACE, TURN = ("x_m", "y_m", "z_m"), ("qw", "qx", "qy", "qz")
UNIT_WITHIN = 0.01  # a quaternion's length; what a table rounds is much nearer
MOST_TURN_RAD = 1.5  # from row to row: more cannot be told from less the other way round
STILL_SIZES = 20.0  # a body that is further away than so many of its edges is in other units


def read_poses_csv(path: Path, up: str = "z", edge_m: float | None = None) -> Poses:
    """Reads poses; one line says what is wrong.

    Args:
      path: the csv.
      up: the track's axis that points up, "z" or "y"; poses come back with z up.
      edge_m: the body's largest edge where it is declared, to find units mixed up.

    Raises:
      InputError: a column is missing, times do not increase, a row is no pose, or lengths are
        not metres.
    """
    with named(path):
        times, place, quaternion = _read(Path(path), edge_m)
    if up == "y":
        place = place @ np.array([[1.0, 0, 0], [0, 0, 1], [0, -1, 0]])
        half = np.sqrt(0.5)  # a quarter turn about x
        w, x, y, z = quaternion.T
        quaternion = half * np.stack([w - x, w + x, y - z, y + z], axis=1)
    return Poses(Path(path).stem, times, place, quaternion)


def _read(path: Path, edge_m: float | None) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Times `[row]`, places `[row, 3]` and quaternions `[row, 4]`."""
    (_, header), *rows = read_cells(path)
    titled = {title: at for at, title in enumerate(header) if title}
    columns = {title: _column(titled, title) for title in (TIME, *PLACE, *TURN)}
    for line, row in rows:
        if len(row) <= max(columns.values()):
            raise InputError(
                f"line {line}: {len(row)} cells; {len(header)} expected as in the header"
            )
    table = values_of(rows, columns)
    lines = [f"line {line}" for line, _ in rows]
    check_times(table[TIME], lines)
    place, quaternion = (np.stack([table[title] for title in titles], axis=1)
                         for titles in (PLACE, TURN))  # fmt: skip
    _check_places(place, lines, edge_m)
    return table[TIME], place, _checked_turns(quaternion, lines)


def _column(columns: dict[str, int], title: str) -> int:
    if title in columns:
        return columns[title]
    ending = [name for name in columns if name.endswith(f"_{title}") and title != TIME]
    if len(ending) != 1:
        what = "missing" if not ending else f"more than one body: {', '.join(ending)}"
        raise InputError(f"column {title!r}: {what}; poses have {', '.join((TIME, *PLACE, *TURN))}")
    return columns[ending[0]]


def _check_places(place: np.ndarray, lines: list[str], edge_m: float | None) -> None:
    if (empty := ~np.isfinite(place).all(axis=1)).any():
        raise InputError(f"{lines[int(empty.argmax())]}: a place is empty; metres expected")
    largest = float(np.abs(place).max())
    moved = float(np.ptp(place, axis=0).max())
    if largest > MAX_POSITION_M or (edge_m and moved > STILL_SIZES * edge_m):
        raise InputError(
            f"places up to {largest:g} m, and a way of {moved:g} m; metres expected; are "
            "these millimetres (divide them by 1000)?"
        )
    if edge_m and moved < edge_m / 100:
        raise InputError(
            f"places within {moved:g} m; metres expected; are these kilometres, or does "
            "it not move?"
        )


def _checked_turns(quaternion: np.ndarray, lines: list[str]) -> np.ndarray:
    """The quaternions `[row, 4]` at length 1, each of the sign that is nearer to the last."""
    if (empty := ~np.isfinite(quaternion).all(axis=1)).any():
        raise InputError(f"{lines[int(empty.argmax())]}: qw to qz: empty; numbers expected")
    length = np.linalg.norm(quaternion, axis=1)
    if (wrong := np.abs(length - 1) > UNIT_WITHIN).any():
        at = int(wrong.argmax())
        raise InputError(
            f"{lines[at]}: qw, qx, qy, qz: no rotation, their squares' root is "
            f"{length[at]:.4g}; 1 expected"
        )
    quaternion = quaternion / length[:, None]
    signs = np.cumprod(np.sign(np.sum(quaternion[1:] * quaternion[:-1], axis=1)) + 0.0)
    quaternion[1:] *= np.where(signs == 0, 1.0, signs)[:, None]
    cosine = np.clip(np.sum(quaternion[1:] * quaternion[:-1], axis=1), -1, 1)
    if (jumps := 2 * np.arccos(cosine) > MOST_TURN_RAD).any():
        at = int(jumps.argmax()) + 1
        turn = np.degrees(2 * np.arccos(cosine[at - 1]))
        raise InputError(
            f"{lines[at]}: turned by {turn:.0f} degrees since the row before; less than "
            f"{np.degrees(MOST_TURN_RAD):.0f} expected; is the real part (qw) first?"
        )
    return quaternion
