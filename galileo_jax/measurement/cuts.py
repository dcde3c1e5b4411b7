"""The part of a track that is motion of the scene, and what ends it.

Real clips show more than their scene: the hand that lets go, the stop at the end of a board, a
blow by something that is no partner. What lies beyond is left out, and a `Cut` says where and why.

    board without a table    from the rest after which it comes down, and from where the hand is
                             off; to a stop, a blow, or the rest after which it is carried away
    level                    from where it gains no more speed; to a stop or a blow
    fall, flight, board      to where the film goes over to slow motion
    fall, flight             from where the hand is off; to a stop (fall) or a blow, unless a floor
                             is declared
    toss                     to the first impact
    pendulum, spring, liquid from where it is let go, to a blow or a stop
    ramp                     to where a box tips over, two that touch turn aside, or object 1 comes
                             back to the foot
    from_above               to a blow where neither another puck nor a declared wall is, or to a
                             quarter of a second after everything has come to rest
"""

from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, replace
from typing import Any

import numpy as np

from galileo_jax.clip.poses_csv import read_poses_csv
from galileo_jax.clip.scenarios import SCENARIOS
from galileo_jax.clip.schema import Clip
from galileo_jax.measurement.find_blow import blow_frame, goes_on
from galileo_jax.measurement.find_bounce import bounce_frame
from galileo_jax.measurement.find_fold import fold_frame
from galileo_jax.measurement.find_hand import hand_frame, pushed_frame, thrown_frame
from galileo_jax.measurement.find_held import let_go_frame, standstill_frame
from galileo_jax.measurement.find_placed import placed_frames
from galileo_jax.measurement.find_rate_change import rate_change
from galileo_jax.measurement.find_rest import rest_frame
from galileo_jax.measurement.find_return import return_frame
from galileo_jax.measurement.find_stop import SMEARED_FRAMES, arrest_frame
from galileo_jax.measurement.find_stranger import stranger_frame
from galileo_jax.measurement.find_tip import tip
from galileo_jax.measurement.toss_flight import last_free_frame
from galileo_jax.observation.observation import Observation

STOPPED = "is stopped by something that is not in the scene"
STRUCK = "is struck by something that is not in the scene: its velocity jumps there"
CHANGES_RATE = (
    "goes on {:.3g} times as fast, its acceleration by the square of that: the frame rate changes "
    "there (slow motion?), which only a cut film or a table with true times can mend"
)
LANDED = "comes down on the table"
RESTS = "is at rest, and so is everything else that is still seen"
PLACED = "is put into its place by a hand before that"
TAKEN = "is taken away by a hand from then on"
TIPS_OVER = "tips over onto another face"
FOLDS = "turns aside and slides past what it pushes: their centres come closer than at the hit"
RETURNS = "comes back to the foot of the ramp, where its edge meets the slope"
IS_HELD = "is held before that"
HELD = "is moved by a hand before that: it accelerates differently from later"

PUSHED = "is pushed by a hand before that: it gains speed on a level table"

SWINGS = ("pendulum", "spring", "liquid")


@dataclass(frozen=True)
class Cut:
    """Where the part of a track that is used begins or ends.

    Attributes:
      name: the object's.
      time_s: of the first frame that is used, or of the last.
      side: which part is left out.
      why: a phrase with the object as its subject.
    """

    name: str
    time_s: float
    side: str  # "before" or "after"
    why: str

    def __str__(self) -> str:
        """One line, without the clip's name."""
        return f"{self.name} {self.why}; everything {self.side} {self.time_s:.3f} s is left out"


def is_board(clip: Clip) -> bool:
    """Whether it shows a board without a table."""
    scenario = SCENARIOS[clip.scenario]
    return scenario.has_ramp and not scenario.has_table


def cut(clip: Clip, observation: Observation) -> tuple[Observation, tuple[Cut, ...]]:
    """The observation with what is not of the scene masked, and where and why, in time's order."""
    if SCENARIOS[clip.scenario].is_level:
        return _of_pucks(clip, observation)
    if SCENARIOS[clip.scenario].has_table:
        return _of_a_ramp(clip, observation)
    laws = SCENARIOS[clip.scenario].laws
    why = HELD
    is_let_go = is_board(clip) and not clip.starts_moving and "start_velocity" not in laws
    observation, cuts = _left_to_itself(observation) if is_let_go else (observation, [])
    swings = clip.scenario in SWINGS
    if swings and (first := let_go_frame(observation)) is not None:
        observation = _without(observation, slice(None, first))
        time_s = float(observation.times_s[first])
        cuts.append(Cut(observation.names[0], time_s, "before", IS_HELD))
    ends = [
        (frame, why)
        for frame, why in (
            (find(observation), why)
            for find, why in _ends(clip, observation.position_m.shape[1] == 3)
        )
        if frame is not None
    ]
    may_slow = is_board(clip) or (clip.scenario in ("fall", "flight") and not clip.has_floor)
    if may_slow and (change := rate_change(observation)) is not None:
        ends.append((change.last, CHANGES_RATE.format(change.factor)))
    if ends:
        last, end = min(ends)
        if end == STOPPED and goes_on(observation, last):
            end = STRUCK
        # Of a video: the hit falls into an exposure, whose frame shows neither.
        last -= SMEARED_FRAMES if clip.video is not None else 0
        observation = _without(observation, slice(last + 1, None))
        cuts = [each for each in cuts if each.side == "before"]
        cuts.append(Cut(observation.names[0], float(observation.times_s[last]), "after", end))
    first = hand_frame(observation) if is_let_go else None
    is_free = clip.scenario in ("fall", "flight") and not clip.has_floor
    if is_free and not clip.objects[0].first_frame:
        first = thrown_frame(observation, rest_belongs=clip.scenario == "fall")
    if is_board(clip) and SCENARIOS[clip.scenario].angle_deg == 0:
        first, why = pushed_frame(observation), PUSHED
    if first is not None:
        observation = _without(observation, slice(None, first))
        time_s = float(observation.times_s[first])
        cuts = [each for each in cuts if each.side == "after"]
        cuts.insert(0, Cut(observation.names[0], time_s, "before", why))
    return observation, tuple(cuts)


def cuts_of(measured: Sequence[Any]) -> dict[str, Any]:
    """For a result's document: `{"cuts": {clip: [{name, time_s, side, why}]}}`, or nothing."""
    found = {one.name: [asdict(each) for each in one.cuts] for one in measured if one.cuts}
    return {"cuts": found} if found else {}


def to_last_cut(observation: Observation, cuts: Sequence[Cut]) -> Observation:
    """The observation without the frames that a cut leaves out at its end, which cost only time.

    Those before the first are as they were: frames are counted from the clip's beginning.
    """
    if not any(each.side == "after" for each in cuts):
        return observation
    count = int(np.flatnonzero(observation.mask.any(axis=0))[-1]) + 1
    modes, turned = observation.modes_m, observation.turned_rad
    return replace(
        observation,
        times_s=observation.times_s[:count],
        position_m=observation.position_m[..., :count],
        covariance_m2=observation.covariance_m2[..., :count],
        mask=observation.mask[:, :count],
        modes_m=None if modes is None else modes[..., :count],
        turned_rad=None if turned is None else turned[:, :count],
    )


def _ends(clip: Clip, is_in_space: bool) -> list[tuple[Callable[[Observation], int | None], str]]:
    """What may end the motion of the scene."""
    if is_board(clip) or (clip.scenario == "fall" and not clip.has_floor):
        return [(arrest_frame, STOPPED), (blow_frame, STRUCK)]
    if clip.scenario == "toss" and clip.track is not None:
        poses = read_poses_csv(clip.track, clip.track_up)
        return [(lambda _: last_free_frame(poses, clip.objects[0].size_m), LANDED)]
    if clip.scenario == "flight" and not clip.has_floor:
        return [(bounce_frame if is_in_space else blow_frame, STRUCK)]
    if clip.scenario in SWINGS:
        return [(standstill_frame, STOPPED), (blow_frame, STRUCK)]
    return []


def _left_to_itself(observation: Observation) -> tuple[Observation, list[Cut]]:
    """Without what a hand does before the object lies where it begins, and after it has ended."""
    first, last = placed_frames(observation)
    found, name, times = [], observation.names[0], observation.times_s
    if first is not None:
        observation = _without(observation, slice(None, first))
        found.append(Cut(name, float(times[first]), "before", PLACED))
    if last is not None:
        observation = _without(observation, slice(last + 1, None))
        found.append(Cut(name, float(times[last]), "after", TAKEN))
    return observation, found


def _of_pucks(clip: Clip, observation: Observation) -> tuple[Observation, tuple[Cut, ...]]:
    """To the first blow by a stranger, or to when all that is seen has come to rest.

    Of a film, tracks that leap are looked at by themselves: they may be of something else.
    """
    struck = stranger_frame(clip, observation) if clip.video is None else None
    if struck is None:
        return _to_rest(clip, observation)
    last, which = struck
    found = Cut(observation.names[which], float(observation.times_s[last]), "after", STRUCK)
    return _without(observation, slice(last + 1, None), slice(None)), (found,)


def _to_rest(clip: Clip, observation: Observation) -> tuple[Observation, tuple[Cut, ...]]:
    radii = [item.size_m[0] for item in clip.objects if item.size_m is not None]
    last = rest_frame(observation, min(radii)) if radii else None
    if last is None:
        return observation, ()
    rests = int(np.argmax(observation.mask[:, last]))  # one that is still seen
    found = Cut(observation.names[rests], float(observation.times_s[last]), "after", RESTS)
    return _without(observation, slice(last + 1, None), slice(None)), (found,)


def _of_a_ramp(clip: Clip, observation: Observation) -> tuple[Observation, tuple[Cut, ...]]:
    over = tip(clip, observation)
    ends = [] if over is None else [(over[1], over[0], TIPS_OVER)]
    for front in range(1, len(observation.names)):
        last = fold_frame(clip, observation, front)
        if last is not None:
            ends.append((last, front - 1, FOLDS))
    last = return_frame(clip, observation, 0)
    if last is not None:
        ends.append((last, 0, RETURNS))
    if not ends:
        return observation, ()
    last, which, why = min(ends)
    found = Cut(observation.names[which], float(observation.times_s[last]), "after", why)
    return _without(observation, slice(last + 1, None), slice(None)), (found,)


def _without(observation: Observation, frames: slice, objects: slice | int = 0) -> Observation:
    mask = observation.mask.copy()
    mask[objects, frames] = False
    return replace(observation, mask=mask)
