"""A box that tips over: it goes on on another face, and is no longer the body that was declared.

Seen from the side, with l half its length along the travel, h half its height and d its height on
the table less that before, it tips over if for the last frames

    |d - (l - h)| < AGREES, and |l - h| > TELLS          (it lies on its end)

or if somewhere on the table its centre

    rises by more than TOP (sqrt(l^2 + h^2) - h)         (it stands on an edge, and falls again)

above where it stood and above where it is soon after, so that no slope of the table is taken for
it. What rises less rocks and falls back (`similarity/rocking_discrepancy.py`).
"""

import math

import numpy as np

from galileo_jax.clip.scenarios import SCENARIOS
from galileo_jax.clip.schema import Clip
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


def tip(clip: Clip, observation: Observation) -> tuple[int, int] | None:
    """The first object that tips over, and the last frame before; None where none does."""
    if not SCENARIOS[clip.scenario].has_table or clip.ramp_angle_deg is None:
        return None
    found = [
        (frame, i)
        for i, item in enumerate(clip.objects)
        if item.shape in TIPS and item.size_m is not None and item.roll_inertia is None
        if (frame := _tip_of(clip, observation, i)) is not None
    ]
    return (min(found)[1], min(found)[0]) if found else None


def _tip_of(clip: Clip, observation: Observation, i: int) -> int | None:
    """The last frame before object `i` tips over; None where it does not."""
    from galileo_jax.model.scene.scene import extents

    length, height = extents(clip.objects[i])
    seen = np.flatnonzero(observation.mask[i])
    x, y = observation.position_m[i][:, seen]
    sd = np.sqrt(observation.covariance_m2[i, 1, 1, seen])
    times, angle = observation.times_s[seen], math.radians(clip.ramp_angle_deg or 0.0)
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
