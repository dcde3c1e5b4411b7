"""Pucks seen from above: the distance of their centres at a hit is the sum of their radii.

It tells the scale where the radii are declared and the scale is not; the radii where the scale is
and they are not. Where neither is, lengths are counted in radii of the pucks: a puck is then taken
to have `UNKNOWN_RADIUS_M`, which makes no friction, but leaves accelerations in radii.
"""

import math
from collections.abc import Mapping
from dataclasses import replace
from itertools import combinations
from typing import Any

import numpy as np

from galileo_jax.clip.picture_plane import picture_plane
from galileo_jax.clip.scenarios import SCENARIOS
from galileo_jax.clip.schema import Clip
from galileo_jax.clip.walls import Wall
from galileo_jax.observation.observation import NOMINAL_SCALE_PX_PER_M, Observation
from galileo_jax.runtime.errors import InputError
from galileo_jax.tracking.to_metres import origin_of
from galileo_jax.tracking.track import Track

UNKNOWN_RADIUS_M = 0.02
HEIGHT_M = 0.01  # of a puck of which only the radius matters
BESIDE = 5  # frames on either side of a hit through which lines are laid
LEAST_TURN = 5.0  # standard deviations by which the distance's rate changes at a hit
POINT_SHARE = 0.03  # of the distance: marked points are the centres no better

Found = tuple[Clip, Observation, Mapping[str, Mapping[str, Any]], list[str]]


def is_level(clip: Clip) -> bool:
    """Whether the clip shows pucks on a table from above."""
    return SCENARIOS[clip.scenario].is_level


def from_first_common_frame(clip: Clip, observation: Observation) -> Observation:
    """The observation without what is before the first frame in which every puck is seen.

    Raises:
      InputError: there is none.
    """
    common = np.flatnonzero(observation.mask.all(axis=0))
    if not common.size:
        raise InputError(f"{clip.path}: there is no frame in which every object is seen")
    return observation.without(slice(common[0]))


def with_walls_in_metres(clip: Clip, pixels: Track | None) -> Clip:
    """The clip with walls that were marked in the picture in metres, where its scale is known."""
    if pixels is None or not any(wall.is_in_pixels for wall in clip.walls):
        return clip
    plane = picture_plane(clip, origin_of(clip, pixels))
    walls = []
    for wall in clip.walls:
        if wall.is_in_pixels:
            (x, y), (u, v) = plane.to_metres(np.array([wall.from_px, wall.to_px])).tolist()
            wall = Wall(from_m=(x, y), to_m=(u, v))
        walls.append(wall)
    return clip.model_copy(update={"walls": tuple(walls)})


def told_by_hit(clip: Clip, observation: Observation) -> Found:
    """The clip with a scale and radii, the observation in its metres, and what was inferred."""
    sizes = [item.size_m for item in clip.objects]
    if clip.is_scale_known and all(sizes):
        return clip, observation, {}, []
    hit = distance_at_hit(observation)
    if hit is None:
        radii = [UNKNOWN_RADIUS_M if size is None else size[0] for size in sizes]
        return _with_radii(clip, radii), observation, {}, []
    i, j, apart, sd = hit
    if clip.is_scale_known:
        known = [sizes[k][0] for k in (i, j) if sizes[k] is not None]  # pyright: ignore
        share = (apart - sum(known)) / (2 - len(known)) if len(known) < 2 else 0.0
        radii = [max(share, 1e-3) if size is None else size[0] for size in sizes]
        names = ", ".join(item.name for item in clip.objects if item.size_m is None)
        line = f"{names}: size_m: null; a radius of {share:.4f} m is used, from the hit"
        found = {
            f"{item.name}.size_m": {"mean": share, "sd": sd}
            for item in clip.objects
            if item.size_m is None
        }
        return _with_radii(clip, radii), observation, found, [line]
    is_known = all(sizes)
    radii = [UNKNOWN_RADIUS_M if size is None or not is_known else size[0] for size in sizes]
    larger = (radii[i] + radii[j]) / apart
    scale = NOMINAL_SCALE_PX_PER_M / larger
    update: dict[str, Any] = {"pixels_per_metre": scale, "is_scale_assumed": not is_known}
    if not is_known:
        line = (
            "pixels_per_metre, size_m: null; lengths are in radii of the pucks, assumed equal: "
            "friction coefficients are not known, decelerations in radii/s^2 are"
        )
        return _scaled(_with_radii(clip, radii), observation, larger, update, {}, line)
    update["pixels_per_metre_sd"] = scale * sd / apart
    line = (
        f"pixels_per_metre: null; {scale:.1f} +- {scale * sd / apart:.1f} is used, from the "
        "distance of the centres at the hit"
    )
    found = {"pixels_per_metre": {"mean": scale, "sd": scale * sd / apart}}
    return _scaled(clip, observation, larger, update, found, line)


def distance_at_hit(observation: Observation) -> tuple[int, int, float, float] | None:
    """Which two pucks hit each other first, and how far their centres are apart then, m, and sd.

    None where none does: where the distance's rate does not jump.
    """
    times = observation.times_s
    for i, j in combinations(range(len(observation.names)), 2):
        both = np.flatnonzero(observation.mask[i] & observation.mask[j])
        if len(both) < 2 * BESIDE + 2:
            continue
        place = observation.position_m[:, :2]
        apart = np.linalg.norm(place[j] - place[i], axis=0)[both]
        at = int(np.argmin(apart))
        # Frames beside the nearest: the hit falls into one exposure or the next.
        before, after = slice(max(at - BESIDE, 0), at), slice(at + 1, at + 1 + BESIDE)
        if min(before.stop - before.start, len(apart[after])) < BESIDE:
            continue
        t = times[both]
        down, up = (np.polyfit(t[part] - t[at], apart[part], 1) for part in (before, after))
        variance = np.einsum("oaaf->of", observation.covariance_m2[[i, j], :2, :2][:, :, :, both])
        noise = math.sqrt(float(np.nanmedian(variance.sum(axis=0))) / 2)
        step = float(np.median(np.diff(t)))
        if up[0] - down[0] < LEAST_TURN * noise / (step * BESIDE):
            continue
        when = (up[1] - down[1]) / (down[0] - up[0])
        distance = float(np.polyval(down, when))
        return i, j, distance, math.hypot(noise, POINT_SHARE * distance)
    return None


def _with_radii(clip: Clip, radii: list[float]) -> Clip:
    objects = tuple(
        item if item.size_m is not None else item.model_copy(update={"size_m": (radius, HEIGHT_M)})
        for item, radius in zip(clip.objects, radii, strict=True)
    )
    return clip.model_copy(update={"objects": objects})


def _scaled(
    clip: Clip,
    observation: Observation,
    larger: float,
    update: Mapping[str, Any],
    found: Mapping[str, Mapping[str, Any]],
    line: str,
) -> Found:
    """With all lengths so many times as large; turning stays."""
    size = np.array([larger, larger, 1.0])[: observation.position_m.shape[1]]
    modes = None if observation.modes_m is None else observation.modes_m * size[:, None]
    scaled = replace(
        observation,
        position_m=observation.position_m * size[:, None],
        covariance_m2=observation.covariance_m2 * np.outer(size, size)[:, :, None],
        modes_m=modes,
    )
    return clip.model_copy(update=update), scaled, found, [line]
