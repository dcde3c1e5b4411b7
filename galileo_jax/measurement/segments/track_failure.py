"""Tracks gone astray: where what is tracked is not, or hardly, the object that was marked.

The tracker drops what does not look like its object (correlation below 0.7), and may go on with
something that does. So there are three signs, looked for in every object's track:

    leapt   it changes its speed as only a blow could, where nothing is to be hit
    shared  of pucks seen from above: it is where another one is; at least one of the tracks is
            of something else, and both are left out from there on
    lost    it is not found any more, though it did not leave the picture

Something that looks the same, and where the object might well be after a time out of sight, only
the fit tells from it.
"""

from dataclasses import dataclass

import numpy as np

from galileo_jax.clip.scenarios import SCENARIOS
from galileo_jax.clip.schema import Clip, ClipObject
from galileo_jax.clip.walls import distance_to_wall
from galileo_jax.measurement.segments.foreign_impact import jumps
from galileo_jax.observation.observation import Observation
from galileo_jax.tracking.track import Track

FEWEST_FRAMES = 3
"""In which a change of speed can be seen."""
BLOW_M_S2 = 15.0
"""Half as much again as g: what slides is braked and drawn by less than g."""
CLEAR = 5.0
"""Standard deviations of a change of speed that are no noise."""
NEAR = 1.5
"""Objects whose centres are within this share of their mean size may hit each other; what is
within this share of its size from the foot turns there."""
UNKNOWN_M = 0.06
"""The size of an object that nobody measured."""
LOST_FRAMES = 10
"""An object that is hidden for less is not lost, and one that is outside by then has left."""
LAST_FRAMES = 5
"""Before it is seen no more, tell where an object goes."""
STEPS_ON_WAY = 9
"""Places on a way of two frames at which a puck is compared with the others."""
APART = 0.8
"""Pucks lie side by side: their centres are never within this share of the sum of their radii."""


@dataclass(frozen=True)
class Astray:
    """From when on an object's track is not to be believed, and why.

    Attributes:
      name: the object's.
      time_s: from when on.
      why: in words.
      is_left_out: whether what is tracked from there on is not used.
    """

    name: str
    time_s: float
    why: str
    is_left_out: bool = False

    def __str__(self) -> str:
        """Object and time: 'object1 is lost from 0.63 s on'."""
        return f"{self.name} is lost from {self.time_s:.2f} s on"


def find_astray(clip: Clip, observation: Observation, track: Track) -> tuple[Astray, ...]:
    """The objects whose tracks are not to be believed to their ends.

    Args:
      clip: without a scale leaps are not reported.
      observation: the track in metres, as far as it is used.
      track: in pixels, to the clip's end.
    """
    found = []
    for i, name in enumerate(track.names):
        seen = np.flatnonzero(observation.mask[i])
        if not seen.size:
            continue
        last = int(seen[-1])
        if (shared := _shared(clip, observation, i)) is not None:
            frame, other = shared
            why = f"it is then in the same place as {other}; both are left out from there on"
            found.append(Astray(name, float(observation.times_s[frame]), why, True))
            continue
        if (frame := _leapt(clip, observation, i)) is not None:
            why = "its velocity jumps although it hits nothing: something else is tracked there"
            if SCENARIOS[clip.scenario].is_level:
                why += ", or the puck was struck by something that is not in the scene"
            # Where it is lost soon after, what led there was no longer the puck, either.
            is_left_out = SCENARIOS[clip.scenario].is_level
        elif _is_lost(track, i, last, clip.objects[i].last_frame):
            frame, why = last + 1, "nothing there looks like it; the rest is left out"
            is_left_out = False  # nothing follows
        else:
            continue
        if is_left_out:
            why += "; it is left out from there on"
        found.append(Astray(name, float(observation.times_s[frame]), why, is_left_out))
    return tuple(found)


def longest_absence(observation: Observation) -> tuple[str, float, float] | None:
    """Which object is away for longest before it comes back, and from when to when, s.

    None where none is away for more than a few frames.
    """
    found = None
    for name, mask in zip(observation.names, observation.mask, strict=True):
        seen = np.flatnonzero(mask)
        gaps = np.diff(seen)
        if gaps.size and gaps.max() > max(LOST_FRAMES, found[0] if found else 0):
            at = int(np.argmax(gaps))
            found = (gaps[at], name, seen[at] + 1, seen[at + 1])
    if found is None:
        return None
    _, name, gone, back = found
    return name, float(observation.times_s[gone]), float(observation.times_s[back])


def _shared(clip: Clip, observation: Observation, i: int) -> tuple[int, str] | None:
    """The first frame in which puck `i` is where another one is, and which; None: in none."""
    if not SCENARIOS[clip.scenario].is_level:
        return None
    place, found = observation.position_m[:, :2], None
    for j, other in enumerate(clip.objects):
        both = observation.mask[i] & observation.mask[j]
        sizes = clip.objects[i].size_m, other.size_m
        if j == i or not both.any() or sizes[0] is None or sizes[1] is None:
            continue
        apart = np.where(both, np.linalg.norm(place[j] - place[i], axis=0), np.inf)
        frames = np.flatnonzero(apart < APART * (sizes[0][0] + sizes[1][0]))
        if frames.size and (found is None or frames[0] < found[0]):
            found = int(frames[0]), other.name
    return found


def _leapt(clip: Clip, observation: Observation, i: int) -> int | None:
    """The first frame in which object `i` is where only a blow could have taken it; or None.

    Once it has gone half its size: until then a hand may be at it.
    """
    scenario = SCENARIOS[clip.scenario]
    is_asked = (scenario.has_ramp or scenario.is_level) and clip.is_scale_known
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
            # Of three places that no puck takes one after the other the middle one may be wrong.
            return int(seen[at + 1 if scenario.is_level else at + 2])
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
    for wall in clip.walls:
        if distance_to_wall(places_m.T, wall.ends_m).min() < NEAR * size / 2 + reach_m:
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
