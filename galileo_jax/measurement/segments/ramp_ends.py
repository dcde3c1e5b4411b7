"""What ends the motion of a scene with a ramp and a table: tipping, turning aside, coming back."""

import math

import numpy as np

from galileo_jax.clip.schema import Clip
from galileo_jax.clip.sizes import extents
from galileo_jax.measurement.infer_ramp import distance_at_hit
from galileo_jax.observation.observation import Observation

AGREES_M, TELLS_M = 1e-3, 2.5e-3
STEADY_M = 1.5e-3  # range of heights of what lies on a face
TOP = 0.8
SOON_S = 0.4
STANDS_M = 1e-3  # what is lifted by less stands
CLEAR = 4.0  # standard deviations of a frame
FOOT = 1.2  # half lengths from the foot, within which it may lie across it
STREAK = 3  # frames on end in which it stands
FEWEST_FRAMES = 4  # in which a height is told
TIPS = ("box", "cylinder")
CLOSER_M = 2e-3  # what a hit's distance is known to
BEGINS_M = 5e-4
FOLD_FRAMES = 3
MARGIN_M = 3e-3  # what a point is off the centre
BEYOND_M = 5e-3
SURE = 5.0  # standard deviations that it has come back at least
TIPS_OVER = "tips over onto another face"
FOLDS = "turns aside and slides past what it pushes: their centres come closer than at the hit"
RETURNS = "comes back to the foot of the ramp, where its edge meets the slope"
Half = tuple[float, float]  # of an object's length along the travel and of its height, m


def ramp_end(clip: Clip, observation: Observation) -> tuple[int | None, str, int]:
    """The last frame before the first of these ends, why, and whose it is; None where none is."""
    halves = [extents(item) if item.size_m is not None else None for item in clip.objects]
    found = [(_return_frame(observation, halves[0]), 0, RETURNS)]
    for i, (item, half) in enumerate(zip(clip.objects, halves, strict=True)):
        if item.shape in TIPS and item.roll_inertia is None:
            found.append((_tip_frame(clip, observation, i, half), i, TIPS_OVER))
        if i:
            found.append((_fold_frame(observation, i, halves[i - 1], half), i - 1, FOLDS))
    ends = [(frame, i, why) for frame, i, why in found if frame is not None]
    frame, i, why = min(ends, default=(None, 0, ""))
    return frame, why, i


def _tip_frame(clip: Clip, observation: Observation, i: int, half: Half | None) -> int | None:
    """The last frame before object `i` tips over; None where it does not.

    A box goes on on another face then, and is no longer the body that was declared. Seen from the
    side, with l half its length along the travel, h half its height and d its height on the table
    less that before, it tips over if for the last frames

        |d - (l - h)| < AGREES, and |l - h| > TELLS          (it lies on its end)

    or if somewhere on the table its centre

        rises by more than TOP (sqrt(l^2 + h^2) - h)         (it stands on an edge, and falls again)

    above where it stood and above where it is soon after, so that no slope of the table is taken
    for it. What rises less rocks and falls back (`similarity/rocking_discrepancy.py`).
    """
    if half is None or clip.ramp_angle_deg is None:
        return None
    length, height = half
    path = observation.path(i)
    seen, times, (x, y) = path.frames, path.times_s, path.place_m
    sd = np.sqrt(observation.covariance_m2[i, 1, 1, seen])
    angle = math.radians(clip.ramp_angle_deg)
    on_table = x > FOOT * length + height * math.tan(angle / 2)
    before = np.ones(len(seen), bool) if i else x < -FOOT * length
    if before.sum() < FEWEST_FRAMES or on_table.sum() < FEWEST_FRAMES:
        return None
    stood = (y if i else x * math.sin(angle) + y * math.cos(angle))[before]
    standing = float(np.median(stood[:FEWEST_FRAMES] if i else stood))
    lifted, first = y - standing, int(np.argmax(on_table))
    ends = lifted[first:][-max(FEWEST_FRAMES, int(on_table.sum()) // 3) :]
    noise = CLEAR * float(np.median(sd))
    lies = abs(length - height) > TELLS_M and bool(
        abs(np.median(ends) - (length - height)) < AGREES_M
        and np.ptp(np.quantile(ends, (0.1, 0.9))) < STEADY_M + noise
    )
    top = first + int(np.argmax(lifted[first:]))
    soon = (times > times[top]) & (times <= times[top] + SOON_S)
    falls = lifted[top] - lifted[soon].min() if soon.any() else 0.0
    turns = min(lifted[top], falls) > TOP * (math.hypot(length, height) - height) + noise
    if not (lies or turns):
        return None
    off = on_table & (np.abs(lifted) > np.maximum(STANDS_M, CLEAR * sd))
    if not off.any():
        return None
    at = len(seen) - 1 if lies else top
    # On its way to lying lower it passes the height at which it stood.
    stands = np.flatnonzero(np.convolve(~off[:at], np.ones(STREAK), "valid") == STREAK)
    last = int(stands[-1]) + STREAK - 1 if stands.size else 0
    if not i and not on_table[max(last - 1, 0)]:  # it began while it lay across the foot
        last = int(np.flatnonzero(before)[-1])
    return int(seen[max(last - 1, 0)] if i else seen[last])


def _fold_frame(
    observation: Observation, front: int, rear_half: Half | None, front_half: Half | None
) -> int | None:
    """The last frame before object `front` and the one behind it turn aside; None: they do not.

    To push from behind is unstable: boxes that touch turn, the one to the left, the other to the
    right, and slide past each other. Seen from the side their centres come closer than they were
    when they touched, which nothing that slides along a line can do. They have turned aside if, for
    three frames,

        d < d_hit - CLOSER  and  d < half the declared lengths - CLOSER

    d_hit being the distance at the hit, which is where the lines through it before and after meet.
    """
    hit_m = distance_at_hit(observation, front - 1)
    if hit_m is None or rear_half is None or front_half is None:
        return None
    both = np.flatnonzero(observation.mask[front - 1] & observation.mask[front])
    x, variance = observation.position_m[:, 0], observation.covariance_m2[:, 0, 0]
    apart = (x[front] - x[front - 1])[both]
    sd = math.sqrt(float(np.median((variance[front] + variance[front - 1])[both])))
    closer = min(hit_m, rear_half[0] + front_half[0]) - np.convolve(
        apart, np.full(FOLD_FRAMES, 1 / FOLD_FRAMES), "valid"
    )
    is_closer = closer > CLOSER_M + CLEAR * sd / math.sqrt(FOLD_FRAMES)
    before = np.flatnonzero(closer[: int(np.argmax(is_closer))] < BEGINS_M)
    return int(both[before[-1] + FOLD_FRAMES // 2]) if is_closer.any() and before.size else None


def _return_frame(observation: Observation, half: Half | None) -> int | None:
    """The last frame before object 1, which came down, comes back to the foot; None: it does not.

    A spring pulls it, or a heavy partner throws it back. Where its rear edge meets the foot it is
    stopped or turned by a corner, at an angle that points on a line have no part in: what follows
    is not of the scene. It has come back if it goes backwards with its centre less than half its
    length and MARGIN past the foot, after it was BEYOND farther than that.
    """
    seen = np.flatnonzero(observation.mask[0])
    if half is None or not seen.size:
        return None
    x = observation.position_m[0, 0, seen]
    sd = np.sqrt(np.median(observation.covariance_m2[0, 0, 0, seen]))
    came_back = np.maximum.accumulate(x) - x > BEYOND_M + SURE * sd
    returns = (x[0] < 0.0) & came_back & (x < half[0] + MARGIN_M)
    return int(seen[int(np.argmax(returns)) - 1]) if returns.any() else None
