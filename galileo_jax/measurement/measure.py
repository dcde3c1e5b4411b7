"""Measures a clip: object positions in metres, and what its yaml leaves open.

The way of a film, top to bottom:

    tracking       frames -> places in pixels, with errors          (`tracking.clip.track_clip`)
    in_metres      pixels -> places in metres, with errors          (`observed`)
    off_path       without places beside a path that goes on        (`on_path`)
    infer_*        angle, foot, sizes, scale that the yaml leaves open
    segments       which part of the track is motion of the scene   (`segments.segment`)
    measure        all of it: the `Observation` that a model is compared with
"""

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from galileo_jax.clip.lost_frames import lost_text
from galileo_jax.clip.picture_plane import picture_plane
from galileo_jax.clip.scenarios import SCENARIOS
from galileo_jax.clip.schema import Clip
from galileo_jax.measurement.average_rows import with_rows_averaged
from galileo_jax.measurement.check_frame_rate import frame_rate_doubt, speed_doubt, thread_doubt
from galileo_jax.measurement.in_metres import observed
from galileo_jax.measurement.infer_radii import told_by_hit, with_walls_in_metres
from galileo_jax.measurement.infer_ramp import (
    SIZE_SD_M,
    foot_of_table,
    infer_foot,
    infer_sizes,
    infer_slope,
)
from galileo_jax.measurement.path_direction import (
    OtherWay,
    other_way,
    path_doubt,
    rises_forward,
    turned_back,
    way_text,
)
from galileo_jax.measurement.segments.off_path import on_path
from galileo_jax.measurement.segments.segments import HELD, Cut, Segments, segment
from galileo_jax.measurement.segments.start_speed import may_move, on_ramp, rest_s, start_speed
from galileo_jax.measurement.segments.track_failure import Astray, leaves_picture
from galileo_jax.measurement.wander_size import with_wander
from galileo_jax.observation.observation import Observation
from galileo_jax.runtime.errors import InputError
from galileo_jax.tracking.track import Track

LEAST_FRAMES, LEAST_SHARE = 8, 0.5  # of a clip, that tell whether a model describes it


@dataclass(frozen=True)
class Measurement:
    """A clip and where its objects were seen."""

    clip: Clip  # with what was inferred filled in
    observation: Observation  # in metres, of what is motion of the scene
    whole: Observation  # in metres, to the clip's end
    pixels: Track | None = None  # the track in pixels; None where the clip is a track already
    # key of the clip that was left null to value and sd
    inferred: Mapping[str, Mapping[str, Any]] = field(default_factory=dict)
    segments: Segments = field(default_factory=Segments)  # which part of the track that is, and why
    # of what is declared and of tracks gone astray, one line each; results repeat them
    doubts: tuple[str, ...] = ()
    # of these, what cannot be by what is declared, without the clip's name
    impossible: str | None = None
    remarks: tuple[str, ...] = ()  # what was inferred or left out, one line each
    way: OtherWay | None = None  # of object 1, where its path says another than is declared
    # in how many an object is seen and used, and how many the clip has
    frames_used: int = 0
    frames: int = 0
    # of these, how many no cut leaves out, from the first that is declared on, until all objects
    # have left the picture
    frames_of_scene: int = 0

    @property
    def cuts(self) -> tuple[Cut, ...]:
        """Where and why parts of the track are left out, in time's order."""
        return self.segments.cuts

    @property
    def astray(self) -> tuple[Astray, ...]:
        """Objects whose tracks are not to be believed to their ends."""
        return self.segments.astray

    @property
    def no_verdict(self) -> str | None:
        """Why nothing can be said of whether a model describes the clip; None where it can."""
        used, least = self.frames_used, max(LEAST_FRAMES, LEAST_SHARE * self.frames_of_scene)
        if used >= least or not self.frames:
            return None
        return (
            f"{self.clip.path}: no verdict: only {used} of {self.frames} frames are used; at least "
            f"{LEAST_FRAMES}, and half of those that no cut leaves out, are needed"
        )

    @property
    def name(self) -> str:
        """The clip's, without folder and suffix."""
        return self.clip.path.stem

    @property
    def warnings(self) -> tuple[str, ...]:
        """Everything a user should read once, in the order in which it was found."""
        return (*self.clip.warnings, *self.remarks, *self.doubts)


def inferred(measured: Sequence[Measurement]) -> dict[str, Any]:
    """For a result's document: what was inferred and cut, or nothing.

    `{"inferred": {clip: {key: {mean, sd}}}, "cuts": {clip: [{name, time_s, side, why}]}}`
    """
    found = {
        one.name: {key: dict(value) for key, value in one.inferred.items()}
        for one in measured
        if one.inferred
    }
    cuts = {one.name: [asdict(cut) for cut in one.cuts] for one in measured if one.cuts}
    return ({"inferred": found} if found else {}) | ({"cuts": cuts} if cuts else {})


@dataclass
class _Inferring:
    """What has been inferred so far, and the lines that say so."""

    path: Path
    inferred: dict[str, Any] = field(default_factory=dict)
    remarks: list[str] = field(default_factory=list)

    def say(self, *lines: str) -> None:
        """Keeps lines without the clip's name."""
        self.remarks += [f"{self.path}: {line}" for line in lines]


def measure(clip: Clip) -> Measurement:
    """Tracks a clip's video, or reads its track, and infers what the model needs and is null.

    Raises:
      InputError: an object cannot be followed, or its path does not tell the ramp's angle or foot.
    """
    scenario, told = SCENARIOS[clip.scenario], _Inferring(clip.path)
    in_pixels = clip.track_units in (None, "px")
    if scenario.has_table and in_pixels and clip.origin_px is None:
        clip = _with_foot(clip, told)
    needs_slope, way = scenario.has_ramp and clip.ramp_angle_deg is None, None
    # The object's outline stands along the ramp: a first look, as a disc, tells how steep.
    is_first_look = needs_slope and clip.video is not None
    if scenario.is_sloped and not scenario.has_table:
        clip = _downhill(clip, _seen(_as_discs(clip) if is_first_look else clip), told)
    if is_first_look:
        clip = _inclined(clip, _seen(_as_discs(clip)))
    whole, pixels = observed(clip)
    whole, said = on_path(whole)
    told.say(*said)
    if scenario.has_table and not in_pixels and not clip.is_own_track and clip.track_origin is None:
        whole = _from_foot(clip, whole, told)
    tracked = whole
    if needs_slope:
        clip = _inclined(clip, whole, told)
    else:
        way = other_way(clip, segment(clip, whole).used(whole))
        whole = turned_back(clip, whole, way) if way and way.is_turned_back else whole
    if scenario.is_level:
        clip, whole = _with_pucks(clip, whole, pixels, told)
    if scenario.has_table and any(item.size_m is None for item in clip.objects):
        clip = _with_sizes(clip, whole, told)
    if pixels is not None:
        times_s = np.array(clip.frame_times_s)[: len(pixels.times_s)]
        told.remarks += lost_text(clip.path, times_s, pixels.times_s)
    segments = segment(clip, whole, pixels)
    # A track that goes astray tells nothing of the clock.
    observation = segments.used(whole)
    doubt = path_doubt(clip, observation)
    if doubt is None and not segments.astray:
        doubt = frame_rate_doubt(clip, whole) or speed_doubt(clip, observation)
        doubt = doubt or thread_doubt(clip, whole)
    told.say(*map(str, segments.cuts))
    clip = _moving(clip, observation, segments, told)
    if scenario.is_level or clip.scenario == "toss":
        # The places of a ball in space are as uncertain along its way as its times, which a wander
        # that is told by the track would take for it.
        observation = with_wander(observation, clip.objects, clip.walls)
    frames_used = int(observation.mask.any(axis=0).sum())
    observation, said = with_rows_averaged(observation)
    told.say(*said)
    doubts = [] if way is None else [f"{clip.path}: {way_text(clip, way)}"]
    overlay = f"see the overlay: galileo track {clip.source or clip.path}"
    doubts += [] if doubt is None else [doubt]
    strays = [f"{one}: {one.why}; {overlay}" for one in segments.astray]
    doubts += [f"{clip.path}: {one}" for one in strays]
    of_scene = _of_scene(clip, tracked, segments, pixels)
    impossible = doubt and doubt.removeprefix(f"{clip.path}: ")
    if impossible is None and any(one.is_left_out for one in segments.astray):
        impossible = strays[0]  # what is left may be of something else, too
    return Measurement(
        clip, observation, whole, pixels, told.inferred, segments, tuple(doubts), impossible,
        tuple(told.remarks), way, frames_used, len(whole.times_s), of_scene,
    )  # fmt: skip


def _of_scene(clip: Clip, tracked: Observation, segments: Segments, pixels: Track | None) -> int:
    """How many frames show what is modelled."""
    is_there = segments.within(tracked.times_s)
    is_there[: min(item.first_frame or 0 for item in clip.objects)] = False
    if pixels is not None:
        is_there[_left_picture(pixels) :] = False
        is_there &= tracked.mask.any(axis=0) | ~pixels.is_visible.any(axis=0)  # not in a long rest
    return int(is_there.sum())


def _left_picture(track: Track) -> int:
    """The frame in which the last object has gone out of the picture; beyond all if one stays."""
    gone = [0]
    for i, is_visible in enumerate(track.is_visible):
        last = int(np.flatnonzero(is_visible)[-1]) if is_visible.any() else 0
        gone.append(last + 1 if leaves_picture(track, i, last) else len(track.times_s))
    return max(gone)


def _moving(clip: Clip, observation: Observation, segments: Segments, told: _Inferring) -> Clip:
    """The clip with `starts_moving`, where nobody lets the object go in what is left of it.

    Where it is declared when it is let go on a ramp with a table, whoever moves then was perhaps
    pushed, which is an effect: it is said and not assumed.
    """
    scenario, first = SCENARIOS[clip.scenario], clip.objects[0]
    if "starts_moving" not in scenario.keys:
        return clip
    moving = clip.model_copy(update={"starts_moving": True})
    if any(each.why == HELD for each in segments.cuts):
        return moving
    if clip.starts_moving is not None:
        return clip
    is_declared = scenario.has_table and first.first_frame is not None
    seen = on_ramp(observation) if scenario.has_table else observation
    found = start_speed(seen)
    if found is None:
        is_ramp = is_declared and clip.scenario == "ramp"
        if is_ramp and (rests_s := rest_s(seen)) is not None:
            told.say(
                f"{first.name} rests for {rests_s:.2g} s from frame {first.first_frame} on, where "
                "it is declared to be let go; write `first_frame: null` for it, which takes the "
                "release from the motion, or try the effect release_delay"
            )
        # Who let go what is in a table may have done so before its first row.
        return moving if first.first_frame is None and may_move(seen) else clip
    how_fast = f", at {found.mean_m_s:.3g} +- {found.sd_m_s:.1g} m/s" if clip.is_scale_known else ""
    what_then = (
        "declare `starts_moving: true` if it was let go before, or try the effect initial_push"
        if is_declared
        else "its speed there is inferred (`starts_moving: false` if it is at rest there)"
    )
    told.say(f"{first.name} moves already in the first frame that is used{how_fast}; {what_then}")
    return clip if is_declared else moving


def _seen(clip: Clip) -> Observation:
    """For a first look: the clip's track without places beside its path."""
    return on_path(observed(clip)[0])[0]


def _as_discs(clip: Clip, **update: Any) -> Clip:
    """For a first look, which does not know how they stand: the disc that fits into each object."""
    discs = tuple(
        item.model_copy(update={"shape": "sphere", "size_m": (min(item.size_m[::2]) / 2,)})
        if item.shape == "box" and item.size_m is not None
        else item
        for item in clip.objects
    )
    return clip.model_copy(update={"objects": discs, **update})


def _with_foot(clip: Clip, told: _Inferring) -> Clip:
    """The clip with the foot of its ramp, from a first look at the path."""
    assert clip.pixels_per_metre is not None  # check_scale requires it of a ramp
    about = (0.0, 0.0) if clip.rectangle is None else clip.rectangle.corners_px[0]
    first_look = _seen(_as_discs(clip, origin_px=about))
    x, y = picture_plane(clip, about).to_pixels(infer_foot(clip, first_look))
    origin = (round(float(x), 1), round(float(y), 1))
    # As good as the point that was followed is the object's centre.
    sd_px = round(SIZE_SD_M * clip.pixels_per_metre, 1)
    told.inferred["origin_px"] = {"mean": list(origin), "sd": sd_px}
    told.say(
        f"origin_px: null; {list(origin)} +- {sd_px:.1f} is used, from the bend of "
        f"{clip.objects[0].name}'s path"
    )
    return clip.model_copy(update={"origin_px": origin})


def _from_foot(clip: Clip, whole: Observation, told: _Inferring) -> Observation:
    """The observation from the foot of its ramp on, where that is not the origin of its table."""
    foot = foot_of_table(clip, whole)
    if foot is None:
        return whole
    told.inferred["foot_m"] = {"mean": foot.round(4).tolist(), "sd": SIZE_SD_M}
    told.say(
        f"track_origin: null, and the path bends elsewhere; the foot of the ramp is taken to be "
        f"{foot[0]:.3f} m along the travel and {foot[1]:.3f} m above the table's origin "
        "(`track_origin: [0, 0]` if it is there)"
    )
    return replace(whole, position_m=whole.position_m - foot[:, None])


def _downhill(clip: Clip, observation: Observation, told: _Inferring) -> Clip:
    """The clip with the direction in which its board falls, where object 1 is pushed up first."""
    if not rises_forward(clip, segment(clip, observation).used(observation)):
        return clip
    other = "left" if clip.direction == "right" else "right"
    told.say(
        f"{observation.names[0]} goes up to the {clip.direction}: the board falls to the {other}"
    )
    return clip.model_copy(update={"direction": other})


def _inclined(clip: Clip, observation: Observation, told: _Inferring | None = None) -> Clip:
    """The clip with the ramp's angle from the path; without `told` nothing is said of it."""
    slope = infer_slope(clip, segment(clip, observation).used(observation))
    if told is not None:
        told.inferred["ramp_angle_deg"] = {"mean": slope.angle_deg, "sd": slope.sd_deg}
        told.say(
            f"ramp_angle_deg: null; {observation.names[0]}'s path falls by "
            f"{slope.angle_deg:.2f} +- {slope.sd_deg:.2f} degrees, which is used"
        )
    found = {"ramp_angle_deg": slope.angle_deg, "ramp_angle_sd_deg": slope.sd_deg}
    return clip.model_copy(update=found)


def _with_sizes(clip: Clip, observation: Observation, told: _Inferring) -> Clip:
    """The clip with sizes from the heights of the paths and the distance at the hit."""
    found = infer_sizes(clip, observation)
    for name, size in found.items():
        told.say(f"{name}: size_m: null; {list(size)} is used, from its path")
        told.inferred[f"{name}.size_m"] = {"mean": list(size), "sd": SIZE_SD_M}
    objects = tuple(
        item.model_copy(update={"size_m": found.get(item.name, item.size_m)})
        for item in clip.objects
    )
    return clip.model_copy(update={"objects": objects})


def _with_pucks(
    clip: Clip, whole: Observation, pixels: Track | None, told: _Inferring
) -> tuple[Clip, Observation]:
    """From where all pucks are seen on, with the scale or radii from a hit."""
    common = np.flatnonzero(whole.mask.all(axis=0))
    if not common.size:
        raise InputError(f"{clip.path}: there is no frame in which every object is seen")
    clip, whole, found, said = told_by_hit(clip, whole.without(slice(common[0])))
    told.inferred |= found
    told.say(*said)
    return with_walls_in_metres(clip, pixels), whole
