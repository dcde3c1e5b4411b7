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
from galileo_jax.clip.schema import Clip
from galileo_jax.clip.walls import Wall
from galileo_jax.measurement.in_metres import origin_of
from galileo_jax.numerics.units import NOMINAL_SCALE_PX_PER_M
from galileo_jax.observation.observation import Observation
from galileo_jax.tracking.track import Track

UNKNOWN_RADIUS_M = 0.02
HEIGHT_M = 0.01  # of a puck of which only the radius matters
BESIDE = 5  # frames on either side of a hit through which lines are laid
LEAST_TURN = 5.0  # standard deviations by which the distance's rate changes at a hit
POINT_SHARE = 0.03  # of the distance: marked points are the centres no better
Found = tuple[Clip, Observation, Mapping[str, Mapping[str, Any]], list[str]]


def with_walls_in_metres(clip: Clip, pixels: Track | None) -> Clip:
    """The clip with walls that were marked in the picture in metres, where its scale is known."""
    if pixels is None or not any(wall.is_in_pixels for wall in clip.walls):
        return clip
    plane = picture_plane(clip, origin_of(clip, pixels))

    def in_metres(wall: Wall) -> Wall:
        if not wall.is_in_pixels:
            return wall
        (x, y), (u, v) = plane.to_metres(np.array([wall.from_px, wall.to_px])).tolist()
        return Wall(from_m=(x, y), to_m=(u, v))

    return clip.model_copy(update={"walls": tuple(map(in_metres, clip.walls))})


def told_by_hit(clip: Clip, observation: Observation) -> Found:
    """The clip with a scale and radii, the observation in its metres, and what was inferred."""
    declared = [None if item.size_m is None else item.size_m[0] for item in clip.objects]
    is_known = None not in declared
    if clip.is_scale_known and is_known:
        return clip, observation, {}, []
    radii = [UNKNOWN_RADIUS_M if radius is None else radius for radius in declared]
    hit = distance_at_hit(observation)
    if hit is None:
        return _with_radii(clip, radii), observation, {}, []
    i, j, apart, sd = hit
    if clip.is_scale_known:
        known = [radius for radius in (declared[i], declared[j]) if radius is not None]
        share = (apart - sum(known)) / (2 - len(known)) if len(known) < 2 else 0.0
        radii = [max(share, 1e-3) if radius is None else radius for radius in declared]
        unknown = [item.name for item in clip.objects if item.size_m is None]
        line = (
            f"{', '.join(unknown)}: size_m: null; a radius of {share:.4f} m is used, from the hit"
        )
        found = {f"{name}.size_m": {"mean": share, "sd": sd} for name in unknown}
        return _with_radii(clip, radii), observation, found, [line]
    if is_known:
        larger = (radii[i] + radii[j]) / apart
        scale = NOMINAL_SCALE_PX_PER_M / larger
        scale_sd = scale * sd / apart
        found = {"pixels_per_metre": {"mean": scale, "sd": scale_sd}}
        line = (
            f"pixels_per_metre: null; {scale:.1f} +- {scale_sd:.1f} is used, from the "
            "distance of the centres at the hit"
        )
        update = {"is_scale_assumed": False, "pixels_per_metre_sd": scale_sd}
    else:
        larger, found, update = 2 * UNKNOWN_RADIUS_M / apart, {}, {"is_scale_assumed": True}
        scale = NOMINAL_SCALE_PX_PER_M / larger
        line = (
            "pixels_per_metre, size_m: null; lengths are in radii of the pucks, assumed equal: "
            "friction coefficients are not known, decelerations in radii/s^2 are"
        )
        clip = _with_radii(clip, [UNKNOWN_RADIUS_M for _ in radii])
    clip = clip.model_copy(update={"pixels_per_metre": scale} | update)
    return clip, _enlarged(observation, larger), found, [line]


def distance_at_hit(observation: Observation) -> tuple[int, int, float, float] | None:
    """Which two pucks hit each other first, and how far their centres are apart then, m, and sd.

    None where none does: where the distance's rate does not jump.
    """
    times = observation.times_s
    for i, j in combinations(range(len(observation.names)), 2):
        apart = observation.apart_m(i, j)
        both = np.flatnonzero(np.isfinite(apart))
        if len(both) < 2 * BESIDE + 2:
            continue
        apart = apart[both]
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
        distance = float(np.polyval(down, (up[1] - down[1]) / (down[0] - up[0])))
        return i, j, distance, math.hypot(noise, POINT_SHARE * distance)
    return None


def _with_radii(clip: Clip, radii: list[float]) -> Clip:
    """The clip with radii of the pucks that have none."""
    objects = tuple(
        item.model_copy(update={"size_m": item.size_m or (radius, HEIGHT_M)})
        for item, radius in zip(clip.objects, radii, strict=True)
    )
    return clip.model_copy(update={"objects": objects})


def _enlarged(observation: Observation, times: float) -> Observation:
    """With all lengths so many times as large; turning stays."""
    size = np.array([times, times, 1.0])[: observation.position_m.shape[1]]
    modes = observation.modes_m
    return replace(
        observation,
        position_m=observation.position_m * size[:, None],
        covariance_m2=observation.covariance_m2 * np.outer(size, size)[:, :, None],
        modes_m=None if modes is None else modes * size[:, None],
    )
