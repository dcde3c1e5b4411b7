"""Tracks gone astray: where what is tracked is not, or hardly, the object that was marked.

The tracker drops what does not look like its object (correlation below 0.7), and may go on with
something that does. So there are three signs, looked for in every object's track:

    leapt   it changes its speed as only a blow could, where nothing is to be hit; it is left out
            from there on
    shared  of pucks seen from above: it is where another one is; at least one of the tracks is
            of something else, and both are left out from there on
    lost    it is not found any more, though it did not leave the picture

Something that looks the same, and where the object might well be after a time out of sight, only
the fit tells from it.
"""

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from galileo_jax.clip.scenarios import SCENARIOS
from galileo_jax.clip.schema import Clip, ClipObject
from galileo_jax.measurement.segments.blow import jumps
from galileo_jax.measurement.segments.foreign_impact import STEPS_ON_WAY
from galileo_jax.numerics.line_segments import distance_to_segment
from galileo_jax.observation.observation import Observation
from galileo_jax.tracking.track import Track

FEWEST_FRAMES = 3  # in which a change of speed can be seen
BLOW_M_S2 = 15.0  # half as much again as g: what slides is braked and drawn by less than g
CLEAR = 5.0  # standard deviations of a change of speed that are no noise
NEAR = 1.5
"""Objects whose centres are within this share of their mean size may hit each other; what is
within this share of its size from the foot turns there."""
UNKNOWN_M = 0.06  # the size of an object that nobody measured
LOST_FRAMES = 10
"""An object that is hidden for less is not lost, and one that is outside by then has left."""
LAST_FRAMES = 5  # before it is seen no more, tell where an object goes
APART = 0.8
"""Pucks lie side by side: their centres are never within this share of the sum of their radii."""


@dataclass(frozen=True)
class Astray:
    """From when on an object's track is not to be believed, and why."""

    name: str  # the object's
    time_s: float  # from when on
    why: str  # in words
    is_left_out: bool = False  # whether what is tracked from there on is not used

    def __str__(self) -> str:
        """Object and time: 'object1 is lost from 0.63 s on'."""
        return f"{self.name} is lost from {self.time_s:.2f} s on"


def find_astray(clip: Clip, observation: Observation, track: Track) -> tuple[Astray, ...]:
    """The objects whose tracks are not to be believed; without a scale nothing leaps."""
    found = []
    for i, name in enumerate(track.names):
        seen = np.flatnonzero(observation.mask[i])
        if not seen.size:
            continue
        frame, last, is_left_out = None, int(seen[-1]), True
        if (shared := _shared(clip, observation, i)) is not None:
            frame, other = shared
            why = f"it is then in the same place as {other}; both are left out from there on"
        elif (frame := _leapt(clip, observation, i)) is not None:
            # Where it is lost soon after, what led there was no longer the object, either.
            why = (
                "its velocity jumps although it hits nothing: something else is tracked there, or "
            )
            why += (
                "it was struck by something that is not in the scene; it is left out from there on"
            )
        elif _is_lost(track, i, last, clip.objects[i].last_frame):
            frame, is_left_out = last + 1, False  # nothing follows
            why = "nothing there looks like it; the rest is left out"
        if frame is not None:
            found.append(Astray(name, float(observation.times_s[frame]), why, is_left_out))
    return tuple(found)


def longest_absence(observation: Observation) -> tuple[str, float, float] | None:
    """Which object is away for longest before it comes back, and from when to when, s.

    None where none is away for more than a few frames.
    """
    gaps = [
        (back - gone, name, gone, back)
        for name, mask in zip(observation.names, observation.mask, strict=True)
        for seen in [np.flatnonzero(mask)]
        for gone, back in pairwise(seen)
    ]
    length, name, gone, back = max(gaps, key=lambda gap: gap[0], default=(0, "", 0, 0))
    if length <= LOST_FRAMES:
        return None
    return name, float(observation.times_s[gone + 1]), float(observation.times_s[back])


def _shared(clip: Clip, observation: Observation, i: int) -> tuple[int, str] | None:
    """The first frame in which puck `i` is where another one is, and which; None: in none."""
    own, found = clip.objects[i], []
    for j, other in enumerate(clip.objects):
        if j == i or own.size_m is None or other.size_m is None:
            continue
        near = APART * (own.size_m[0] + other.size_m[0])
        frames = np.flatnonzero(observation.apart_m(i, j) < near)
        found += [(int(frame), other.name) for frame in frames[:1]]
    is_level = SCENARIOS[clip.scenario].is_level
    return min(found, key=lambda one: one[0], default=None) if is_level else None


def _leapt(clip: Clip, observation: Observation, i: int) -> int | None:
    """The first frame in which object `i` is where only a blow could have taken it; or None.

    Once it has gone half its size: until then a hand may be at it.
    """
    scenario = SCENARIOS[clip.scenario]
    is_asked = scenario.has_surface and clip.is_scale_known
    path = observation.path(i)
    seen = path.frames
    if not is_asked or len(path) < FEWEST_FRAMES:
        return None
    place = path.place_m[:2]
    step_s, velocity, _ = path.steps
    gone = np.hypot(*(place[:, 1:-1] - place[:, :1])) > _size_m(clip.objects[i]) / 2
    for at in np.flatnonzero(jumps(path, BLOW_M_S2, CLEAR) & gone):
        way = velocity[:2, at] * (step_s[at] + step_s[at + 1])
        if scenario.is_level:
            on_way = place[:, at, None] + way[:, None] * np.linspace(0.0, 1.0, STEPS_ON_WAY)
            may_meet = _may_meet(clip, observation, i, on_way, seen[at : at + 3])
        else:
            there, reach_m = place[:, at + 1, None], float(np.hypot(*way))
            may_meet = _may_meet(clip, observation, i, there, seen[at + 1 : at + 2], reach_m)
        if not may_meet:
            # Of three places that nothing takes one after the other the middle one may be wrong.
            return int(seen[at + 1])
    return None


def _may_meet(
    clip: Clip,
    observation: Observation,
    i: int,
    places_m: np.ndarray,
    frames: np.ndarray,
    reach_m: float = 0.0,
) -> bool:
    """Whether object `i`, at some places `[2, place]`, may meet another, a wall or the ramp's foot.

    One that is not seen in one of the frames may be anywhere.
    """
    size = _size_m(clip.objects[i])
    if SCENARIOS[clip.scenario].has_table and abs(places_m[0]).min() < NEAR * size + reach_m:
        return True
    to_walls = (distance_to_segment(places_m.T, wall.ends_m).min() for wall in clip.walls)
    if any(away < NEAR * size / 2 + reach_m for away in to_walls):
        return True
    for j, other in enumerate(clip.objects):
        there = observation.position_m[j, :2][:, frames]
        apart = np.linalg.norm(places_m[:, :, None] - there[:, None, :], axis=0)
        if j != i and not apart.min() > NEAR * (size + _size_m(other)) / 2 + reach_m:
            return True
    return False


def _size_m(declared: ClipObject) -> float:
    """The largest of its declared lengths; a radius counts twice."""
    if declared.size_m is None:
        return UNKNOWN_M
    return max(declared.size_m) * (1 if declared.shape == "box" else 2)


def leaves_picture(track: Track, i: int, last: int) -> bool:
    """Whether object `i`, last seen in frame `last`, goes out of the picture soon after that."""
    seen = np.flatnonzero(track.is_visible[i, : last + 1])[-LAST_FRAMES:]
    place = track.position_px[i, seen]
    if len(seen) < 2:
        return False
    goes_to = place[-1] + LOST_FRAMES * (place[-1] - place[0]) / (seen[-1] - seen[0])
    return bool(((goes_to < 0) | (goes_to > np.array(track.frame_size_px) - 1)).any())


def _is_lost(track: Track, i: int, last: int, last_used: int | None) -> bool:
    """Whether object `i`, last seen in frame `last`, should be in the picture after that."""
    after = (len(track.times_s) - 1 if last_used is None else last_used) - last
    is_back = track.is_visible[i, last + 1 :].any()
    return after >= LOST_FRAMES and not is_back and not leaves_picture(track, i, last)
