"""Measures a clip: object positions in metres, and what its yaml leaves open.

The yaml may leave open the angle, the origin and sizes.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from galileo_jax.clip.lost_frames import lost_text, with_lost_frames
from galileo_jax.clip.picture_plane import picture_plane
from galileo_jax.clip.scenarios import SCENARIOS
from galileo_jax.clip.schema import Clip
from galileo_jax.clip.track_file import read_track
from galileo_jax.measurement.average_rows import with_rows_averaged
from galileo_jax.measurement.camera_modes import with_camera_modes
from galileo_jax.measurement.check_frame_rate import frame_rate_doubt
from galileo_jax.measurement.coding_errors import with_coding_errors
from galileo_jax.measurement.errors_at_rest import with_errors_at_rest
from galileo_jax.measurement.infer_foot import infer_foot, needs_foot
from galileo_jax.measurement.infer_radii import (
    from_first_common_frame,
    is_level,
    told_by_hit,
    with_walls_in_metres,
)
from galileo_jax.measurement.infer_sizes import SIZE_SD_M, infer_sizes, needs_sizes
from galileo_jax.measurement.infer_slope import Slope, infer_slope, needs_slope
from galileo_jax.measurement.path_direction import OtherWay, other_way, turned_back, way_text
from galileo_jax.measurement.segments.segments import (
    HELD,
    Cut,
    Phase,
    Segments,
    cuts_of,
    segment,
)
from galileo_jax.measurement.segments.start_speed import on_ramp, rest_s, start_speed
from galileo_jax.measurement.segments.track_failure import Astray, leaves_picture
from galileo_jax.measurement.shared_errors import beside, with_errors
from galileo_jax.measurement.track_cache import track_once
from galileo_jax.measurement.turning import with_turning
from galileo_jax.measurement.wander_size import with_wander
from galileo_jax.observation.observation import Observation
from galileo_jax.tracking.to_metres import observe
from galileo_jax.tracking.track import Track

LEAST_FRAMES, LEAST_SHARE = 8, 0.5
"""Of a clip, that tell whether a model describes it."""


@dataclass(frozen=True)
class Measurement:
    """A clip and where its objects were seen.

    Attributes:
      clip: with what was inferred filled in.
      observation: in metres, of what is motion of the scene.
      whole: in metres, to the clip's end.
      pixels: the track in pixels; None where the clip is a track already.
      inferred: key of the clip that was left null to value and sd.
      segments: which part of the track that is, and why.
      doubts: of what is declared and of tracks gone astray, one line each; results repeat them.
      remarks: what was inferred or left out, one line each.
      way: of object 1, where its path says another than is declared.
      frames_used, frames: in how many an object is seen and used, and how many the clip has.
      frames_of_scene: of these, how many no cut leaves out, from the first that is declared on,
        until all objects have left the picture.
    """

    clip: Clip
    observation: Observation
    whole: Observation
    pixels: Track | None = None
    inferred: Mapping[str, Mapping[str, Any]] = field(default_factory=dict)
    segments: Segments = field(default_factory=Segments)
    doubts: tuple[str, ...] = ()
    remarks: tuple[str, ...] = ()
    way: OtherWay | None = None
    frames_used: int = 0
    frames: int = 0
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
    """For a result's document: `{"inferred": {clip: {key: {mean, sd}}}}` and `cuts_of`."""
    found = {
        one.name: {key: dict(value) for key, value in one.inferred.items()}
        for one in measured
        if one.inferred
    }
    return ({"inferred": found} if found else {}) | cuts_of(measured)


def measure(clip: Clip) -> Measurement:
    """Tracks a clip's video, or reads its track, and infers what the model needs and is null.

    Raises:
      InputError: an object cannot be followed, or its path does not tell the ramp's angle or foot.
    """
    found: dict[str, Any] = {}
    remarks: list[str] = []
    if needs_foot(clip):
        clip = _with_foot(clip, remarks)
        found["origin_px"] = {"mean": list(clip.origin_px or ()), "sd": _foot_sd_px(clip)}
    measured = _with_slope(clip, remarks) if needs_slope(clip) else _on_its_way(clip)
    measured = _with_pucks(measured, remarks) if is_level(clip) else measured
    measured = _with_sizes(measured, remarks) if needs_sizes(measured.clip) else measured
    pixels, doubt = measured.pixels, frame_rate_doubt(measured.clip, measured.observation)
    if pixels is not None:
        remarks.extend(
            lost_text(
                clip.path, np.array(clip.frame_times_s)[: len(pixels.times_s)], pixels.times_s
            )
        )
    segments = segment(measured.clip, measured.observation, pixels)
    remarks.extend(f"{clip.path}: {each}" for each in segments.cuts)
    observation = segments.used(measured.observation)
    measured = replace(measured, clip=_moving(measured.clip, observation, segments, remarks))
    if is_level(measured.clip) or clip.scenario == "toss":
        # The places of a ball in space are as uncertain along its way as its times, which a wander
        # that is told by the track would take for it.
        pucks = measured.clip
        observation = with_wander(observation, pucks.objects, pucks.walls)
    frames_used = int(observation.mask.any(axis=0).sum())
    if not observation.is_tracked_here:
        observation, said = with_rows_averaged(observation)
        remarks.extend(f"{clip.path}: {line}" for line in said)
    other_doubts = (
        f"{clip.path}: {one}: {one.why}; see the overlay: galileo track {clip.source or clip.path}"
        for one in segments.astray
    )
    way = [] if measured.way is None else [f"{clip.path}: {way_text(clip, measured.way)}"]
    return replace(
        measured,
        observation=observation,
        inferred={**found, **measured.inferred},
        segments=segments,
        doubts=(*way, *([] if doubt is None else [doubt]), *other_doubts),
        remarks=tuple(remarks),
        frames_used=frames_used,
        frames=len(measured.whole.times_s),
        frames_of_scene=_of_scene(clip, measured.whole, segments, pixels),
    )


def _on_its_way(clip: Clip) -> Measurement:
    """A measurement whose points are turned, if need be, to where the clip says that they go."""
    whole, pixels = observed(clip)
    way = other_way(clip, segment(clip, whole).used(whole), may_turn=not whole.is_tracked_here)
    if way is not None and way.is_turned_back:
        whole = turned_back(clip, whole, way)
    return Measurement(clip, whole, whole, pixels, way=way)


def _of_scene(clip: Clip, whole: Observation, segments: Segments, pixels: Track | None) -> int:
    """How many frames show what is modelled."""
    phases = segments.phases(whole.names, whole.times_s)
    is_there = ((phases == Phase.SCENE) | (phases == Phase.ASTRAY)).any(axis=0)
    is_there[: min(item.first_frame or 0 for item in clip.objects)] = False
    if pixels is not None:
        is_there[_left_picture(pixels) :] = False
    return int(is_there.sum())


def _left_picture(track: Track) -> int:
    """The frame in which the last object has gone out of the picture; beyond all if one stays."""
    gone = [0]
    for i, is_visible in enumerate(track.is_visible):
        last = int(np.flatnonzero(is_visible)[-1]) if is_visible.any() else 0
        gone.append(last + 1 if leaves_picture(track, i, last) else len(track.times_s))
    return max(gone)


def _moving(clip: Clip, observation: Observation, segments: Segments, remarks: list[str]) -> Clip:
    """The clip with `starts_moving`, where nobody lets the object go in what is left of it.

    On a ramp with a table whoever moves at first was perhaps pushed, which is an effect: it is said
    and not assumed.
    """
    scenario = SCENARIOS[clip.scenario]
    if any(each.why == HELD for each in segments.cuts) and "starts_moving" in scenario.keys:
        return clip.model_copy(update={"starts_moving": True})
    if clip.starts_moving is not None or "starts_moving" not in scenario.keys:
        return clip
    seen = on_ramp(observation) if scenario.has_table else observation
    found, name = start_speed(seen), clip.objects[0].name
    if found is None:
        if clip.scenario == "ramp" and clip.objects[0].first_frame is not None:
            remarks.extend(_resting(clip, rest_s(seen)))
        return clip
    how_fast = f", at {found.mean_m_s:.3g} +- {found.sd_m_s:.1g} m/s" if clip.is_scale_known else ""
    what_then = (
        "declare `starts_moving: true` if it was let go before, or try the effect initial_push"
        if scenario.has_table
        else "its speed there is inferred (`starts_moving: false` if it is at rest there)"
    )
    remarks.append(
        f"{clip.path}: {name} moves already in the first frame that is used{how_fast}; {what_then}"
    )
    return clip if scenario.has_table else clip.model_copy(update={"starts_moving": True})


def _resting(clip: Clip, rests_s: float | None) -> tuple[str, ...]:
    """That object 1 is let go later than in its first frame, a line; nothing where it is not."""
    if rests_s is None:
        return ()
    name, first = clip.objects[0].name, clip.objects[0].first_frame
    return (
        f"{clip.path}: {name} rests for {rests_s:.2g} s from frame {first} on, where it "
        "is declared to be let go; write `first_frame: null` for it, which takes the release from "
        "the motion, or try the effect release_delay",
    )


def observed(clip: Clip) -> tuple[Observation, Track | None]:
    """The clip's track in metres, and in pixels where it is tracked here.

    Raises:
      InputError: an object cannot be followed.
    """
    if clip.video is None:
        assert clip.track is not None  # load_clip requires one of the two
        read = read_track(clip.path, clip.track, clip, clip.fps)
        observation = (
            with_errors(beside(clip.track), read.observation) if read.is_own else read.observation
        )
        return _as_declared(clip, observation), None
    pixels = track_once(clip)
    seen = np.where(pixels.is_visible[..., None], pixels.position_px, np.nan)
    times_s = with_lost_frames(pixels.times_s, np.moveaxis(seen, 1, 2))
    pixels = replace(pixels, times_s=times_s)
    observation = with_errors_at_rest(observe(clip, pixels))
    observation = with_coding_errors(clip, observation, pixels)
    observation = with_camera_modes(clip, observation, pixels)
    return with_turning(observation) if clip.turning else observation, pixels


def _as_declared(clip: Clip, observation: Observation) -> Observation:
    """Without what is before the first and after the last frames; tracking begins and ends so."""
    for i, item in enumerate(clip.objects):
        observation = observation.without(slice(item.first_frame or 0), i)
        if item.last_frame is not None:
            observation = observation.without(slice(item.last_frame + 1, None), i)
    return observation


def _with_foot(clip: Clip, remarks: list[str]) -> Clip:
    """The clip with the foot of its ramp, from a first look at the path."""
    assert clip.pixels_per_metre is not None  # check_scale requires it of a ramp
    about = (0.0, 0.0) if clip.rectangle is None else clip.rectangle.corners_px[0]
    first_look, _ = observed(_without_sizes(clip, origin_px=about))
    x, y = picture_plane(clip, about).to_pixels(infer_foot(clip, first_look))
    origin = (round(float(x), 1), round(float(y), 1))
    clip = clip.model_copy(update={"origin_px": origin})
    remarks.append(
        f"{clip.path}: origin_px: null; {list(origin)} +- {_foot_sd_px(clip):.1f} is used, from "
        f"the bend of {clip.objects[0].name}'s path"
    )
    return clip


def _foot_sd_px(clip: Clip) -> float:
    """As good as the point that was followed is the object's centre."""
    assert clip.pixels_per_metre is not None
    return round(SIZE_SD_M * clip.pixels_per_metre, 1)


def _without_sizes(clip: Clip, **update: Any) -> Clip:
    """For a first look: outlines are placed by what is not known yet."""
    unknown = tuple(item.model_copy(update={"size_m": None}) for item in clip.objects)
    return clip.model_copy(update={"objects": unknown, **update})


def _with_slope(clip: Clip, remarks: list[str]) -> Measurement:
    """A measurement with the ramp's angle from the path."""
    if clip.video is not None:
        # The object's outline stands along the ramp: a first look, without it, tells how steep.
        first_look, _ = observed(_without_sizes(clip))
        clip = _inclined(clip, infer_slope(clip, segment(clip, first_look).used(first_look)))
    observation, pixels = observed(clip)
    slope = infer_slope(clip, segment(clip, observation).used(observation))
    clip = _inclined(clip, slope)
    remarks.append(
        f"{clip.path}: ramp_angle_deg: null; {observation.names[0]}'s path falls by "
        f"{slope.angle_deg:.2f} +- {slope.sd_deg:.2f} degrees, which is used"
    )
    found = {"mean": slope.angle_deg, "sd": slope.sd_deg}
    return Measurement(clip, observation, observation, pixels, {"ramp_angle_deg": found})


def _with_sizes(measured: Measurement, remarks: list[str]) -> Measurement:
    """The measurement with sizes from the heights of the paths and the distance at the hit."""
    clip = measured.clip
    found = infer_sizes(clip, measured.observation)
    objects = tuple(
        item.model_copy(update={"size_m": found.get(item.name, item.size_m)})
        for item in clip.objects
    )
    entries = dict(measured.inferred)
    for name, size in found.items():
        remarks.append(f"{clip.path}: {name}: size_m: null; {list(size)} is used, from its path")
        entries[f"{name}.size_m"] = {"mean": list(size), "sd": SIZE_SD_M}
    clip = clip.model_copy(update={"objects": objects})
    return replace(measured, clip=clip, inferred=entries)


def _with_pucks(measured: Measurement, remarks: list[str]) -> Measurement:
    """The measurement from where all pucks are seen on, with the scale or radii from a hit."""
    observation = from_first_common_frame(measured.clip, measured.observation)
    clip, observation, found, said = told_by_hit(measured.clip, observation)
    clip = with_walls_in_metres(clip, measured.pixels)
    remarks.extend(f"{clip.path}: {line}" for line in said)
    return replace(measured, clip=clip, observation=observation, whole=observation, inferred=found)


def _inclined(clip: Clip, slope: Slope) -> Clip:
    found = {"ramp_angle_deg": slope.angle_deg, "ramp_angle_sd_deg": slope.sd_deg}
    return clip.model_copy(update=found)
