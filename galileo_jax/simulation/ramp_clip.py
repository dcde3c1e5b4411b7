"""Clips of objects on a ramp: trials of the same objects, drawn, and then written one by one."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from galileo_jax.clip.fields import Shape
from galileo_jax.clip.track_csv import write_observation_csv
from galileo_jax.model.effects.nuisances.foot_transition import FootTransition
from galileo_jax.model.effects.nuisances.impact_restitution import ImpactRestitution
from galileo_jax.model.effects.nuisances.release_instant import ReleaseInstant
from galileo_jax.runtime import progress
from galileo_jax.simulation.clip_files import (
    WriteClip,
    declared_objects,
    noisy_track,
    write_yaml_and_truth,
)
from galileo_jax.simulation.filming import declared_picture, film_ramp, filming_of, ramp_camera
from galileo_jax.simulation.hidden import Hidden, hide
from galileo_jax.simulation.motion import LONGEST_S, Motion, Solver, roll_out
from galileo_jax.simulation.record import truth_record
from galileo_jax.simulation.settings import Settings, shapes_of
from galileo_jax.simulation.truth import Declared, Truth, draw_truth, truth_like
from galileo_jax.video import synthetic

BEYOND_TABLE_M = 2.5  # x, where a clip ends; a board alone ends at 0
SHORTEST_S, AFTER_REST_S = 1.5, 0.4
OFF_PX = (1.0, 4.0)  # how far a point set by hand is off, where the fault is asked for
NUM_TRIES = 12
FARTHEST_M = 2.0  # an object beyond it left the table

# Range of the nuisance parameters in real clips: no verdict may result from them.
KEPT_AT_FOOT, REBOUND, RELEASE_FRAMES = (0.96, 1.0), (0.0, 0.04), (-0.3, 0.3)


def ramp_clips(settings: Settings, hidden: Sequence[Hidden], stem: str) -> list[WriteClip]:
    """Draws the trials; returns what writes each into the file that it is given.

    Raises:
      InputError: an effect has no place in the scene, or the simulation fails.
    """
    looks, things, faults, secrets = np.random.default_rng(settings.seed).spawn(4)
    fields = {key: getattr(settings, key) for key in ("m1", "k1", "m2", "k2", "z2")}
    given = {key: value for key, value in fields.items() if value is not None}
    solver: Solver = "free" if settings.motion == "free" else settings.solver
    frame_s = 1 / settings.fps if settings.faults else None
    trials = draw_series(
        settings.angle,
        given | dict(settings.values),
        hidden,
        settings.series or 1,
        solver=solver,
        things=things,
        secrets=secrets,
        frame_s=frame_s,
        scenario=settings.scenario,
        shapes=shapes_of(settings),
    )
    truth = trials[0][0]
    if settings.like is not None:
        truth = truth_like(Path(settings.like), settings.angle, settings.scenario)
        truth = with_faults(truth, secrets, frame_s)
    if settings.release is not None:
        truth = replace(truth, release_m=settings.release)
    if truth is not trials[0][0]:
        trials = [(truth, roll_out(truth, solver))]
    series = stem if settings.series else None
    return [
        partial(
            _write, settings, truth, motion, looks, faults, seed=settings.seed + i, series=series
        )
        for i, (truth, motion) in enumerate(trials)
    ]


def _write(
    settings: Settings,
    truth: Truth,
    motion: Motion,
    looks: np.random.Generator,
    faults: np.random.Generator,
    out: Path,
    *,
    seed: int,
    series: str | None,
) -> None:
    """Writes one clip, its yaml and its truth into the folder of `out`."""
    declared = Declared.of(truth.effect_values, settings.fps, truth.ramp_angle_deg)
    ends = motion.leaves_s(BEYOND_TABLE_M if truth.surroundings.has_table else 0.0)
    longest = min(LONGEST_S, ends + declared.release_s)
    at_rest = motion.rest_s + declared.release_s + AFTER_REST_S
    seconds = settings.seconds or min(longest, max(SHORTEST_S, at_rest))
    num_frames = max(2, round(seconds * declared.true_fps))
    frames = motion.at(declared.taken_s(num_frames))
    camera = ramp_camera(settings, truth, frames, faults)
    content = _content(settings, out.name, truth, declared, camera, frames, faults)
    record = {
        "name": out.stem,
        "series": series,
        **truth_record(truth, declared, motion, frames),
        "pixels_per_metre_true": camera.pixels_per_metre,
        "pixels_per_metre_declared": content.get("pixels_per_metre", camera.pixels_per_metre),
        "world_to_image": camera.world_to_image.tolist(),
        "image_px": list(camera.size_px),
        "camera_faults": sorted(settings.camera_fault),
        "seed": seed,
    }
    if settings.track_only:
        # The centres, as the declared scale and clock show them.
        shown, times = declared.scale * frames.position_m, np.arange(num_frames) / declared.fps
        names, sd = truth.surroundings.names, np.full(shown.shape[:2], settings.track_noise)
        write_observation_csv(out, noisy_track(names, times, shown, sd, looks))
    else:
        filming = filming_of(settings, declared, num_frames, faults)
        record |= film_ramp(out, truth, declared, motion, camera, filming, num_frames, seed)
    write_yaml_and_truth(out, content, record)


def _content(
    settings: Settings,
    name: str,
    truth: Truth,
    declared: Declared,
    camera: synthetic.Camera,
    frames: Motion,
    rng: np.random.Generator,
) -> dict[str, Any]:
    """What the yaml declares about the clip (docs/reference/clip_yaml.md)."""
    objects = declared_objects(truth.objects)
    picture: dict[str, Any] = {}
    if not settings.track_only:
        off = {
            fault: _off_px(rng, count) if fault in settings.camera_fault else np.zeros((count, 2))
            for fault, count in (("origin", 1), ("points", len(objects)))
        }
        origin = np.round(camera.origin_px + off["origin"][0], 1).tolist()
        picture = declared_picture(camera, declared.scale) | {"origin_px": origin}
        if not settings.no_points:
            points = camera.project(frames.position_m[:, :, 0]) + off["points"]
            for entry, point in zip(objects, points, strict=True):
                entry["point_px"] = np.round(point, 1).tolist()
    return {
        "track" if settings.track_only else "video": name,
        "scenario": settings.scenario,
        "fps": declared.fps,
        "ramp_angle_deg": declared.ramp_angle_deg,
        **picture,
        "gravity": truth.gravity,
        "objects": objects,
    }


def _off_px(rng: np.random.Generator, count: int) -> np.ndarray:
    """Errors of points set by hand, `[count, 2]`, in any direction."""
    size, way = rng.uniform(*OFF_PX, count), rng.uniform(0, 2 * np.pi, count)
    return size[:, None] * np.stack([np.cos(way), np.sin(way)], axis=1)


def draw_series(
    ramp_angle_deg: float,
    given: Mapping[str, float],
    hidden: Sequence[Hidden],
    count: int,
    *,
    solver: Solver,
    things: np.random.Generator,
    secrets: np.random.Generator,
    frame_s: float | None = None,
    scenario: str = "ramp",
    shapes: Sequence[Shape] = ("box", "box"),
) -> list[tuple[Truth, Motion]]:
    """Draws `count` trials of the same objects from other heights and distances.

    Where the given values allow it, object 1 hits object 2 in each and nothing leaves the
    table.

    Of the hidden effects' parameters that are drawn, those of a trial differ between clips.
    `things` draws the experiments, `secrets` what is hidden. See `draw_truth`, `with_faults` (which
    has `frame_s`) and `roll_out` for the others.
    """

    def trial(draw: Callable[[], Truth], effects: Sequence[Hidden]) -> tuple[Truth, Motion]:
        return _try(lambda: _with_hidden(draw(), effects, secrets, frame_s), solver)

    trials = [trial(lambda: draw_truth(things, ramp_angle_deg, given, scenario, shapes), hidden)]
    first = trials[0][0]
    known = [_shared(each, first) for each in hidden]
    while len(trials) < count:
        progress.report("simulating", len(trials) / count)
        trials.append(trial(lambda: _moved(first, ramp_angle_deg, given, things), known))
    return trials


def _try(draw: Callable[[], Truth], solver: Solver) -> tuple[Truth, Motion]:
    """The first of some draws in which the objects on the table are hit; else the last."""
    for _ in range(NUM_TRIES):
        truth = draw()
        motion = roll_out(truth, solver)
        events = motion.events_s(truth)
        is_hit = all(events[name] is not None for name in events if name.startswith("hit"))
        if len(truth.objects) < 2 or (len(truth.objects) == 2 and not truth.effects):
            break
        if is_hit and motion.position_m[:, 0].max() < FARTHEST_M:
            break
    return truth, motion


def _with_hidden(
    truth: Truth, hidden: Sequence[Hidden], rng: np.random.Generator, frame_s: float | None
) -> Truth:
    for each in hidden:
        truth = hide(truth, each, rng)
    return with_faults(truth, rng, frame_s)


def with_faults(truth: Truth, rng: np.random.Generator, frame_s: float | None) -> Truth:
    """The truth with the small faults of real clips, drawn anew; as it is without a `frame_s`.

    The release is between frames, `frame_s` apart; foot and impact are not ideal.
    """
    if frame_s is None:
        return truth
    faults = {
        "foot_transition": rng.uniform(*KEPT_AT_FOOT),
        "impact_restitution": rng.uniform(*REBOUND),
        "release_instant": frame_s * rng.uniform(*RELEASE_FRAMES),
    }
    return replace(
        truth,
        effects=(*truth.effects, FootTransition(), ImpactRestitution(), ReleaseInstant()),
        effect_values={**truth.effect_values, **faults},
    )


def _shared(hidden: Hidden, first: Truth) -> Hidden:
    """The same effect, with the first clip's values where they are the objects'.

    Those of a trial are drawn anew, of any strength.
    """
    parameters = hidden.effect.parameters(first.surroundings)
    same = {p.name: first.effect_values[p.name] for p in parameters if not p.per_clip}
    return hidden._replace(given={**hidden.given, **same}, strength=None)


def _moved(
    first: Truth, ramp_angle_deg: float, given: Mapping[str, float], rng: np.random.Generator
) -> Truth:
    """The objects of the first clip without effects, from another height to another place."""
    shapes: list[Shape] = [each.shape for each in first.objects]
    other = draw_truth(rng, ramp_angle_deg, {**given, **first.known}, first.scenario, shapes)
    return replace(other, objects=first.objects)
