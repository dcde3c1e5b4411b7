"""How a board's slope varies along the way, as its path in the picture shows.

The path's height over a straight line is fitted with the integrals of Legendre polynomials, of as
many as make the points likelier by `PER_TERM` nats each. A path that is bent by less than what
bodies wobble, lenses bend and trackers err is straight.
"""

import math

import numpy as np
from numpy.polynomial import legendre

from galileo_jax.clip.schema import Clip
from galileo_jax.model.effects.nuisances.board_shape import LENGTH, MOST, BoardShape
from galileo_jax.numerics.least_squares import least_squares, line_through
from galileo_jax.observation.observation import Observation

LEAST_BEND_M, LEAST_BEND_SHARE = 0.0015, 0.004
"""Of the greatest distance from a straight line; of the way's length. Lenses magnify the edge of a
picture by up to a hundredth more than its middle, and bend a line by less than half of that."""
PER_TERM = 8.0
SLOPE_SD, SLOPE_SD_SHARE = 0.002, 0.1  # rad; of a term: how well the path's slope is the board's
FEWEST = 20  # points
MEAN_SDS = 3.0  # by which the mean slope is another than the angle, that at the start then


def board_shape(clip: Clip, observation: Observation) -> dict[str, tuple[float, float]]:
    """Means and widths of the priors of `BoardShape`; empty where the path is straight."""
    path = observation.path()
    if len(path) < FEWEST:
        return {}
    gone, variance, along = path.gone_m, path.variance_m2, line_through(path.place_m).along
    down = np.array([along[1], -along[0]]) * math.copysign(1.0, along[0])
    way, drop = along @ gone, down @ gone
    length = float(way.max())
    if length <= 0:
        return {}
    u, sd = 2 * way / length - 1, np.sqrt(variance)
    best: tuple[float, np.ndarray, np.ndarray] | None = None
    for terms in range(MOST + 1):
        design = _design(u, terms)
        fit = least_squares(design / sd[:, None], drop / sd)
        left = drop - design @ fit.solution
        if terms == 0 and np.abs(left).max() < max(LEAST_BEND_M, LEAST_BEND_SHARE * length):
            return {}
        # Of the size of what is left: points wobble together.
        cost = 0.5 * len(path) * math.log(np.mean(left**2 / variance)) + PER_TERM * terms
        if best is None or cost < best[0]:
            spread = np.mean(left**2 / variance) * fit.inverse
            best = cost, fit.solution[1:], np.sqrt(np.diagonal(spread))[1:]
    assert best is not None
    _, found, error = best
    if len(found) < 2:
        return {}
    (lean, *slopes), errors = found * 2 / length, error[1:] * 2 / length
    sds = np.hypot(errors, np.maximum(SLOPE_SD, SLOPE_SD_SHARE * np.abs(slopes)))
    priors = zip(slopes, sds, strict=True)
    shape = {f"{BoardShape.name}_{n}": (float(c), float(sd)) for n, (c, sd) in enumerate(priors, 1)}
    assert clip.ramp_angle_deg is not None  # the clip's own validation, or the path's
    mean = math.atan2(-along[1], along[0]) + lean - math.radians(clip.ramp_angle_deg)
    if clip.ramp_angle_sd_deg and abs(mean) > MEAN_SDS * math.radians(clip.ramp_angle_sd_deg):
        shape[f"{BoardShape.name}_0"] = (float(mean), SLOPE_SD)
    return {LENGTH: (length, 0.0)} | shape


def _design(u: np.ndarray, terms: int) -> np.ndarray:
    """An offset, a slope, and the integrals of P_1, P_2, ... over u: `[point, 2 + terms]`."""
    columns = [np.ones_like(u), u]
    for n in range(1, terms + 1):
        columns.append(legendre.legval(u, legendre.legint(np.eye(n + 1)[n])))
    return np.stack(columns, axis=1)
