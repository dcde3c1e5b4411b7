"""Frames that are missing in a table or film whose rows were numbered without a gap.

Where a frame was lost, a body that moves smoothly makes a step of twice the usual length, once. The
step between rows i and i + 1, in units of what its neighbours let expect, is 1 + (frames lost).
"""

from pathlib import Path

import numpy as np

from galileo_jax.clip.track_noise import position_noise_m

WITHIN = 0.25  # of a whole number of frames: rougher jumps are something else
SURE_SDS = 6.0  # by so many standard deviations a step is longer than expected
MOST_LOST, MOST_UNSEEN, LEAST_ROWS = 5, 3, 12
NEIGHBOURS = 2
"""Steps on either side of a jump, which must be there, and nearer to each other than their size."""
STEP_SDS = 13**0.5 / 2
"""Of a step less the mean of these four, by the error of a place: 2 (5/4)^2 + 2 (1/4)^2 = 13/4."""


def with_lost_frames(times: np.ndarray, position: np.ndarray) -> np.ndarray:
    """Times `[row]` with the time of lost frames put back.

    Args:
      times: `[row]`, s.
      position: `[object, axis, row]`, in any unit; NaN where it is not seen.

    Limits: one object, in equal steps of time; not told where it is not seen in more than
    `MOST_UNSEEN` rows.
    """
    seen = np.flatnonzero(np.isfinite(position).all(axis=(0, 1)))
    steps = np.diff(times)
    is_even = len(seen) >= LEAST_ROWS and np.ptp(steps) <= 0.1 * np.median(steps)
    if len(position) != 1 or not is_even:
        return times
    place, rows, step = position[0][:, seen], times[seen], float(np.median(steps))
    lost, numbered = np.zeros(len(seen) - 1, int), np.diff(seen)
    for _ in range(4):  # with more of them known, the errors of the others are known better
        found = _lost_after(rows + step * np.append(0, np.cumsum(lost)), place, numbered, lost)
        if (found == lost).all():
            break
        lost = found
    if not lost.any() or not _is_even_elsewhere(place, numbered, lost):
        return times
    added = np.zeros(len(times))
    added[seen[:-1] + 1] = step * lost
    return times + np.cumsum(added)


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


def _lost_after(
    times: np.ndarray, place: np.ndarray, numbered: np.ndarray, known: np.ndarray
) -> np.ndarray:
    """Frames that are missing in each step `[step]`, of `numbered` rows; 0 where it is even."""
    moved = np.diff(place, axis=1)
    per_frame = moved / (numbered + known)
    sds = [position_noise_m(times, one) for one in place]
    sd = STEP_SDS * float(np.sqrt(np.nansum(np.square(sds)))) if np.isfinite(sds).any() else np.inf
    found = np.zeros_like(known)
    for i in range(NEIGHBOURS, moved.shape[1] - NEIGHBOURS):
        sides = (per_frame[:, i - NEIGHBOURS : i], per_frame[:, i + 1 : i + 1 + NEIGHBOURS])
        expected = np.median(np.concatenate(sides, axis=1), axis=1)
        length = float(np.linalg.norm(expected))
        before, after = (np.mean(side, axis=1) for side in sides)
        # It stops there, sets out, or turns; out of sight it may have been struck.
        most = length if numbered[i] == 1 else WITHIN * length
        if np.linalg.norm(after - before) >= most:
            continue
        times_as_long = float(moved[:, i] @ expected) / length**2
        across = float(np.linalg.norm(moved[:, i] - times_as_long * expected))
        more = times_as_long - numbered[i]
        is_jump = more * length > SURE_SDS * sd and 1 <= round(more) <= MOST_LOST
        is_plain = numbered[i] <= 1 + MOST_UNSEEN and across < 0.5 * length
        if is_jump and is_plain and abs(more - round(more)) < WITHIN:
            found[i] = round(more)
    return found


def _is_even_elsewhere(place: np.ndarray, numbered: np.ndarray, lost: np.ndarray) -> bool:
    """Whether steps change smoothly with the frames put back: else the jumps may be anything."""
    if np.count_nonzero(lost) > place.shape[1] / 4:
        return False
    per_frame = np.diff(place, axis=1) / (numbered + lost)
    bends = np.linalg.norm(np.diff(per_frame, axis=1), axis=0)
    return bool(bends.max() <= 6 * np.median(bends))
