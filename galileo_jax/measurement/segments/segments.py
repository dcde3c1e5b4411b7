"""The segments of a track: held, of the scene, what comes after it, and gone astray.

Real clips show more than their scene: the hand that lets go, the stop at the end of a board, a
blow by something that is no partner. What lies beyond is left out, and a `Cut` says where and why;
what is no more the object that was marked is `Astray`.

    board without a table    from the rest after which it comes down, and from where the hand is
                             off, up the board from where it gains no more speed; to a stop, a blow,
                             the end of the slope, or the rest after which it is carried away
    level                    from where it gains no more speed; to a stop or a blow
    fall, flight, board      to where the film goes over to slow motion
    fall, flight             from where the hand is off, of a fall from the rest after which it
                             comes down; to a stop or a blow, unless a floor is declared
    toss                     to the first impact
    pendulum, spring, liquid from where it is let go, to a blow or a stop
    ramp                     to where a box tips over, two that touch turn aside, or object 1 comes
                             back to the foot
    from_above               from where the first that moves gains no more speed, if it does so
                             before all others move; to a blow where neither another puck nor a
                             declared wall is, or to a quarter of a second after everything has
                             come to rest
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np
from jaxtyping import Bool

from galileo_jax.clip.poses_csv import read_poses_csv
from galileo_jax.clip.scenarios import SCENARIOS
from galileo_jax.clip.schema import Clip
from galileo_jax.measurement.infer_ramp import end_of_slope
from galileo_jax.measurement.segments import blow, handling, rest
from galileo_jax.measurement.segments.foreign_impact import stranger_frame
from galileo_jax.measurement.segments.off_path import end_of_path
from galileo_jax.measurement.segments.ramp_ends import ramp_end
from galileo_jax.measurement.segments.rate_change import rate_change
from galileo_jax.measurement.segments.start_speed import let_go_frame
from galileo_jax.measurement.segments.track_failure import Astray, find_astray
from galileo_jax.observation.observation import Observation
from galileo_jax.observation.toss_flight import last_free_frame
from galileo_jax.tracking.track import Track

STOPPED = "is stopped by something that is not in the scene"
STRUCK = (
    "is struck by something that is not in the scene (declare it, if it is a second object): its "
    "velocity jumps there"
)
CHANGES_RATE = (
    "goes on {:.3g} times as fast, its acceleration by the square of that: the frame rate changes "
    "there (slow motion?), which only a cut film or a table with true times can mend"
)
SLOPE_ENDS = (
    "comes to the end of the slope: its path goes on in another direction (scenario `ramp` has a "
    "table behind it)"
)
LEAVES = "leaves its path in its last frames, too few to tell how (struck, or stopped?)"
LANDED = "comes down on the table"
RESTS = "is at rest, and so is everything else that is still seen"
PLACED = "is put into its place by a hand before that"
TAKEN = "is taken away by a hand from then on"
IS_HELD = "is held before that"
HELD = "is moved by a hand before that: it accelerates differently from later"
PUSHED = "is pushed by a hand before that: it gains speed, and loses it from then on"
SWINGS = ("pendulum", "spring", "liquid")
FREELY = 1.2  # times gravity: what falls from rest speeds up by less
EXPOSED_FRAMES = 1
"""Of a video: the hit falls into an exposure, whose frame shows neither before nor after."""


@dataclass(frozen=True)
class Cut:
    """Where the part of a track that is used begins or ends."""

    name: str  # the object's
    time_s: float  # of the first frame that is used, or of the last
    side: str  # which part is left out: "before" or "after"
    why: str  # a phrase with the object as its subject

    def __str__(self) -> str:
        """One line, without the clip's name."""
        return f"{self.name} {self.why}; everything {self.side} {self.time_s:.3f} s is left out"


@dataclass(frozen=True)
class Segments:
    """Where a track is motion of its scene."""

    cuts: tuple[Cut, ...] = ()  # where it begins and ends, in time's order
    astray: tuple[Astray, ...] = ()  # objects whose tracks are not to be believed to their ends

    def within(self, times_s: np.ndarray) -> Bool[np.ndarray, " frame"]:
        """Which frames no cut leaves out."""
        found = np.ones(len(times_s), bool)
        for cut in self.cuts:
            found &= times_s >= cut.time_s if cut.side == "before" else times_s <= cut.time_s
        return found

    def used(self, observation: Observation) -> Observation:
        """What of an observation is motion of the scene.

        Frames at its end in which nothing is seen any more cost only time, and are gone; those
        before it stay: frames are counted from the clip's beginning.
        """
        seen = observation.mask & self.within(observation.times_s)
        used = replace(observation, mask=seen.copy())
        for one in self.astray:
            if one.is_left_out:
                used.mask[observation.names.index(one.name), used.times_s >= one.time_s] = False
        if not any(cut.side == "after" for cut in self.cuts):
            return used
        return used.between(slice(int(np.flatnonzero(seen.any(axis=0))[-1]) + 1))


def segment(clip: Clip, observation: Observation, track: Track | None = None) -> Segments:
    """The segments of a track; of one made elsewhere (`track` None) nothing has gone astray."""
    scenario, whole = SCENARIOS[clip.scenario], _Kept(observation)
    if scenario.is_level:
        whole = whole.cut("before", *_pushed_puck(observation))
        kept = whole.cut("after", *_end_of_pucks(clip, whole.observation))
    elif scenario.has_table:
        kept = whole.cut("after", *ramp_end(clip, observation))
    else:
        kept = _of_one(clip, whole)
    astray = () if track is None else find_astray(clip, kept.observation, track)
    cuts = (kept.cuts.get(side) for side in ("before", "after"))
    return Segments(tuple(filter(None, cuts)), astray)


@dataclass(frozen=True)
class _Kept:
    """An observation without what has been left out so far, and where it was cut on either side."""

    observation: Observation
    cuts: Mapping[str, Cut] = field(default_factory=dict)

    def cut(self, side: str, frame: int | None, why: str, i: int = 0) -> "_Kept":
        """Without what is before or after a frame that object `i` tells; None: all stays."""
        if frame is None:
            return self
        cut = Cut(self.observation.names[i], float(self.observation.times_s[frame]), side, why)
        gone = slice(frame) if side == "before" else slice(frame + 1, None)
        return _Kept(self.observation.without(gone), {**self.cuts, side: cut})


def _of_one(clip: Clip, kept: _Kept) -> _Kept:
    """Of one object that slides down a board, falls, flies or swings."""
    scenario, is_free, falls = SCENARIOS[clip.scenario], _is_free(clip), clip.scenario == "fall"
    is_let_go = (
        scenario.has_ramp and not clip.starts_moving and "start_velocity" not in scenario.laws
    )
    may_be_held = is_free and not clip.objects[0].first_frame
    if is_let_go or (may_be_held and falls):
        first, last = rest.placed_frames(kept.observation)
        kept = kept.cut("before", first, PLACED).cut("after", last, TAKEN)
    if clip.scenario in SWINGS:
        kept = kept.cut("before", let_go_frame(kept.observation), IS_HELD)
    if (scenario.has_ramp or is_free) and (change := rate_change(kept.observation)) is not None:
        # Before other ends are looked for: a clock that changes looks like a blow.
        last = change[0] - (EXPOSED_FRAMES if kept.observation.is_tracked_here else 0)
        kept = kept.cut("after", last, CHANGES_RATE.format(change[1]))
    pushed, down_m_s2 = None, _down_m_s2(clip, kept.observation)
    if scenario.angle_deg == 0 or (is_let_go and down_m_s2 is not None):
        # A short push is a blow, too, and no end.
        pushed = handling.pushed_frame(kept.observation, least_m_s2=down_m_s2 or 0.0)
        kept = kept.cut("before", pushed, PUSHED)
    if may_be_held:
        kept = kept.cut("before", _first_free(clip, kept.observation), HELD)
    kept = kept.cut("after", *_end_of_one(clip, kept.observation))
    if may_be_held:
        most_m_s2 = FREELY * clip.gravity if falls and clip.is_scale_known else 0.0
        free = handling.thrown_frame(kept.observation, rest_belongs=falls, most_m_s2=most_m_s2)
        if free is None and falls:
            free = handling.shaken_frame(kept.observation)
        return kept.cut("before", free, HELD)
    if is_let_go and scenario.angle_deg != 0 and pushed is None:
        return kept.cut("before", handling.hand_frame(kept.observation, down_m_s2 or 0.0), HELD)
    return kept


def _is_free(clip: Clip) -> bool:
    """Whether object 1 falls or flies, with nothing that it could meet."""
    return clip.scenario in ("fall", "flight") and not clip.has_floor


def _first_free(clip: Clip, observation: Observation) -> int | None:
    """The first frame after a hand's last jump, in what falls or flies; None without one."""
    last = _blow_frame(clip, observation)
    if last is None or not handling.comes_free(observation, last):
        return None
    seen = observation.path().frames
    return int(seen[int(np.searchsorted(seen, last)) + 1 + blow.SMEARED])


def _blow_frame(clip: Clip, observation: Observation) -> int | None:
    """The last frame before object 1 is struck, or bounces."""
    is_in_space = clip.scenario == "flight" and len(observation.axes) == 3
    return blow.bounce_frame(observation) if is_in_space else blow.blow_frame(observation)


def _down_m_s2(clip: Clip, observation: Observation) -> float | None:
    """The most that a board alone can speed object 1 up; None where that is not known."""
    if handling.goes_up(observation):
        return 0.0
    if clip.ramp_angle_deg is None or not clip.is_scale_known:
        return None
    return clip.gravity * math.sin(math.radians(clip.ramp_angle_deg))


def _end_of_one(clip: Clip, observation: Observation) -> tuple[int | None, str]:
    """The last frame before the motion of one object ends, and why; None where it goes on."""
    is_board, is_swing = SCENARIOS[clip.scenario].has_ramp, clip.scenario in SWINGS
    may_be_stopped = is_board or _is_free(clip)
    ends: list[tuple[int | None, str]] = []
    if clip.scenario == "toss" and clip.track is not None:
        poses = read_poses_csv(clip.track, clip.track_up)
        ends.append((last_free_frame(poses, clip.objects[0].size_m), LANDED))
    if may_be_stopped:
        stop = blow.arrest_frame(observation)
        goes_on = stop is not None and blow.goes_on(observation, stop)
        ends.append((stop, STRUCK if goes_on else STOPPED))
    if is_swing:
        ends.append((rest.standstill_frame(observation), STOPPED))
    if is_board:
        ends.append((end_of_slope(observation), SLOPE_ENDS))
    if may_be_stopped:
        ends.append((end_of_path(observation), LEAVES))
    if may_be_stopped or is_swing:
        ends.append((_blow_frame(clip, observation), STRUCK))
    found = [(frame, why) for frame, why in ends if frame is not None]
    if not found:
        return None, ""
    last, why = min(found)
    return last - (EXPOSED_FRAMES if observation.is_tracked_here else 0), why


def _pushed_puck(observation: Observation) -> tuple[int | None, str, int]:
    """The first frame after a push of what moves first, why, and which; no frame: none is pushed.

    As long as nothing else moves: what is struck gains speed, too.
    """
    count = observation.mask.shape[1]
    away = [observation.first_away(i) for i in range(len(observation.names))]
    moves = [count if frame is None else frame for frame in away]
    first, *later = np.argsort(moves, kind="stable")
    alone = observation.without(slice(moves[later[0]] if later else count, None))
    return handling.pushed_frame(alone, int(first)), PUSHED, int(first)


def _end_of_pucks(clip: Clip, observation: Observation) -> tuple[int | None, str, int]:
    """The last frame before a stranger's blow, or before all that is seen is at rest; why; whose.

    Of a film, tracks that leap are looked at by themselves: they may be of something else.
    """
    if not observation.is_tracked_here and (struck := stranger_frame(clip, observation)):
        return struck[0], STRUCK, struck[1]
    radii = [item.size_m[0] for item in clip.objects if item.size_m is not None]
    last = rest.rest_frame(observation, min(radii)) if radii else None
    return last, RESTS, 0 if last is None else int(np.argmax(observation.mask[:, last]))
