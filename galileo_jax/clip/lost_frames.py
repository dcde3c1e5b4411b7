"""Frames that are missing in a table or film whose rows were numbered without a gap.

Where a frame was lost, a body that moves smoothly makes a step of twice the usual length, once. The
step between rows i and i + 1, in units of what its neighbours let expect, is 1 + (frames lost).
"""

from pathlib import Path

import numpy as np

from galileo_jax.clip.track_noise import position_noise_m

WITHIN = 0.25
"""Of a whole number of frames: rougher jumps are something else."""

SURE_SDS = 6.0
"""By so many standard deviations a step is longer than expected."""

MOST_LOST, LEAST_ROWS = 5, 12
NEIGHBOURS = 2
"""Steps on either side of a jump, which must be there, and nearer to each other than their size."""


def with_lost_frames(times: np.ndarray, position: np.ndarray) -> np.ndarray:
    """Times `[row]` with the time of lost frames put back.

    Args:
      times: `[row]`, s.
      position: `[object, axis, row]`, in any unit; NaN where it is not seen.

    Limits: one object, seen in every row from the first to the last, in equal steps of time.
    """
    seen = np.flatnonzero(np.isfinite(position).all(axis=(0, 1)))
    steps = np.diff(times)
    is_even = len(seen) >= LEAST_ROWS and np.ptp(steps) <= 0.1 * np.median(steps)
    if len(position) != 1 or not is_even or len(seen) <= seen[-1] - seen[0]:
        return times
    place, rows = position[0][:, seen], times[seen]
    lost: dict[int, int] = {}
    for _ in range(4):  # with more of them known, the errors of the others are known better
        found = _lost_after(_restored(rows, lost), place, lost)
        if found == lost:
            break
        lost = found
    if not lost or not _is_even_elsewhere(place, lost):
        return times
    return _restored(times, {int(seen[0]) + row: count for row, count in lost.items()})


def lost_text(path: Path, times: np.ndarray, restored: np.ndarray) -> tuple[str, ...]:
    """Which frames were lost, a line, by times `[row]`, s, before and after; nothing: none were."""
    lost = np.round((np.diff(restored) - np.diff(times)) / np.median(np.diff(times))).astype(int)
    if not lost.any():
        return ()
    after = np.flatnonzero(lost)
    listed = [f"{row} ({lost[row]})" if lost[row] > 1 else f"{row}" for row in after]
    return (
        f"{path}: frames are missing after rows {', '.join(listed)}, counted from 0, where it "
        "jumps by whole steps; their time is put back",
    )


def _restored(times: np.ndarray, lost: dict[int, int]) -> np.ndarray:
    added = np.zeros(len(times))
    for row, count in lost.items():
        added[row + 1 :] += count * float(np.median(np.diff(times)))
    return times + added


def _per_frame(place: np.ndarray, lost: dict[int, int]) -> np.ndarray:
    """`[axis, step]`: steps, each over the frames that it takes."""
    moved = np.diff(place, axis=1)
    return moved / (1 + np.array([lost.get(i, 0) for i in range(moved.shape[1])]))


def _lost_after(times: np.ndarray, place: np.ndarray, known: dict[int, int]) -> dict[int, int]:
    """Row after which frames are missing to how many; empty where the motion is even."""
    moved, per_frame = np.diff(place, axis=1), _per_frame(place, known)
    sds = [position_noise_m(times, one) for one in place]
    sd = np.sqrt(2) * float(np.nanmax(sds)) if np.isfinite(sds).any() else np.inf
    found = {}
    for i in range(NEIGHBOURS, moved.shape[1] - NEIGHBOURS):
        around = [j for j in range(i - NEIGHBOURS, i + NEIGHBOURS + 1) if j != i]
        expected = np.median(per_frame[:, around], axis=1)
        length = float(np.linalg.norm(expected))
        sides = (per_frame[:, i - NEIGHBOURS : i], per_frame[:, i + 1 : i + 1 + NEIGHBOURS])
        before, after = (np.mean(side, axis=1) for side in sides)
        if np.linalg.norm(after - before) >= length:  # it stops there, sets out, or turns
            continue
        times_as_long = float(moved[:, i] @ expected) / length**2
        across = float(np.linalg.norm(moved[:, i] - times_as_long * expected))
        count = round(times_as_long) - 1
        is_jump = (times_as_long - 1) * length > SURE_SDS * sd and 1 <= count <= MOST_LOST
        if is_jump and abs(times_as_long - 1 - count) < WITHIN and across < 0.5 * length:
            found[i] = count
    return found


def _is_even_elsewhere(place: np.ndarray, lost: dict[int, int]) -> bool:
    """Whether steps change smoothly with the frames put back: else the jumps may be anything."""
    if len(lost) > place.shape[1] / 4:
        return False
    bends = np.linalg.norm(np.diff(_per_frame(place, lost), axis=1), axis=0)
    return bool(bends.max() <= 6 * np.median(bends))
