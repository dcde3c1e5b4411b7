"""One fit of several tosses of the same box: what they share, and how well that is known.

    residual = (place / PLACE_SD_M, turning / TURN_SD_RAD)

The errors are not those of a camera (0.02 mm) but of the model: corners are no points, a plate
gives way. Each impact multiplies what the start is off by, so that the fit goes out from the first
impact in stages, each of which starts where the one before ended.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from galileo_jax.inference.toss.least_squares import Solution, solve
from galileo_jax.inference.toss.residuals import (
    COMMON,
    EDGE,
    Seen,
    Start,
    backward,
    forward,
    left_over,
)
from galileo_jax.observation.poses import Poses
from galileo_jax.observation.toss_flight import Flight, flight_of, resting_height_m
from galileo_jax.runtime import progress
from galileo_jax.runtime.errors import InputError

PLACE_SD_M, TURN_SD_RAD = 0.001, np.radians(1.0)
OWN_SD = np.repeat([0.002, 0.02, 0.05, 0.5], 3)  # of a start about what its flight told
STAGES_S = (0.02, 0.06, 0.1)  # after the first impact
PRIOR = {"friction": 0.2, "restitution": 0.2, "rounding": 0.002, "inertia": 0.2}  # the middles
# Widths: of logarithms, of the restitution's log-odds; of floor and centre in metres.
FLOOR_SD_M, CENTRE_SD_M = 0.001, 0.005
PRIOR_SD = np.array([1.0, 1.0, 0.03, FLOOR_SD_M, 0.05, 0.7, 0.3, *3 * [CENTRE_SD_M]])
REST_SD_M = 2e-4  # of the height at rest, where it is seen: poses are placed to a tenth of it
FRAMES = 16  # the length of a window is rounded up to multiples, so that fits share programs

left_of_all = jax.jit(jax.vmap(left_over, (None, 0, 0, 0)))
_slopes = jax.jit(jax.vmap(jax.jacfwd(left_over, argnums=(0, 1)), (None, 0, 0, 0)))


@dataclass(frozen=True)
class TossSolution:
    """What the tosses say."""

    mean: np.ndarray  # `[common]`, in the order of `COMMON`, in their units
    covariance: np.ndarray  # `[common, common]`, likewise
    solution: Solution  # in the space of the search
    names: tuple[str, ...]  # of the tosses that were used
    rms: np.ndarray  # `[toss]`, of whitened residuals within the window
    start: Start  # first guesses, `[toss, ...]`


def fit_poses(
    tosses: Sequence[Poses], edge_m: float, gravity: float, window_s: float | None = None
) -> TossSolution:
    """Fits cubes of one size.

    `edge_m`, and `gravity` in m/s^2, are as declared; the fit may change them by some per cent.
    `window_s`: how far after the first impact the fit looks. None: to the last of `STAGES_S`.

    Raises:
      InputError: no toss flies for long enough before its first impact.
    """
    kept = with_flights(tosses, edge_m)
    start = starts_of([flight for _, flight in kept])
    last_s = window_s or STAGES_S[-1]
    stages = [stage for stage in STAGES_S if stage < last_s] + [last_s]
    ends = [flight.last for _, flight in kept]
    usual = {**PRIOR, "edge": edge_m, "gravity": gravity}
    middle = np.array(backward(jnp.asarray([usual.get(name, 0.0) for name in COMMON])))
    poses, prior_sd = [one for one, _ in kept], PRIOR_SD.copy()
    resting_m = resting_height_m(poses)
    if resting_m is not None:
        middle[EDGE], prior_sd[EDGE] = np.log(resting_m), REST_SD_M / resting_m
    common, own = middle, np.zeros((len(kept), len(OWN_SD)))
    windows = [_until(poses, ends, stage) for stage in stages]
    seen = padded(poses, -(-max(windows[-1]) // FRAMES) * FRAMES + 1)
    for index, until in enumerate(windows):
        with progress.part(index / len(stages), (index + 1) / len(stages)):
            solution = solve_window(seen, start, until, common, own, middle, prior_sd)
            common, own = solution.common, solution.own
    by = np.asarray(jax.jacfwd(forward)(jnp.asarray(common)))
    square = np.sum(solution.residuals**2, axis=(1, 2))
    return TossSolution(
        np.asarray(forward(jnp.asarray(common))),
        by @ solution.covariance @ by.T,
        solution,
        tuple(one.name for one in poses),
        np.sqrt(square / (6 * np.array(windows[-1]))),
        start,
    )


def with_flights(tosses: Sequence[Poses], edge_m: float) -> list[tuple[Poses, Flight]]:
    """The tosses that fly before their first impact, each with its flight.

    Raises:
      InputError: there is none.
    """
    size = np.full(3, edge_m)
    kept = [(poses, flight) for poses in tosses if (flight := flight_of(poses, size)) is not None]
    if not kept:
        raise InputError(
            f"{', '.join(poses.name for poses in tosses)}: none flies for some frames before its "
            "first impact; poses from the throw on, z = 0 at the table's level, expected"
        )
    return kept


def _until(tosses: Sequence[Poses], ends: Sequence[int], stage_s: float) -> list[int]:
    """The first frame of each toss that is later after its first impact than a stage."""
    return [
        int(np.searchsorted(one.times_s, one.times_s[end] + stage_s, "right"))
        for one, end in zip(tosses, ends, strict=True)
    ]


def solve_window(
    seen: Seen,
    start: Start,
    until: Sequence[int],
    common: np.ndarray,
    own: np.ndarray,
    middle: np.ndarray,
    prior_sd: np.ndarray,
) -> Solution:
    """Fits the frames before `until` `[toss]` of each toss, from `common` and `own` `[toss, 12]`.

    `seen` (see `padded`) and `start`, first guesses, are `[toss, ...]`; `middle` and `prior_sd` are
    of the prior of what all share.
    """
    is_in = np.arange(seen.position_m.shape[1]) < np.asarray(until)[:, None]
    scale = np.repeat([1 / PLACE_SD_M, 1 / TURN_SD_RAD], 3) * is_in[..., None]

    def residuals(z: np.ndarray, changes: np.ndarray) -> np.ndarray:
        left = np.asarray(left_of_all(jnp.asarray(z), jnp.asarray(changes), start, seen))
        return np.where(is_in[..., None], left * scale, 0.0)

    def slopes(z: np.ndarray, changes: np.ndarray) -> tuple[Any, Any]:
        found = _slopes(jnp.asarray(z), jnp.asarray(changes), start, seen)
        one, other = (np.asarray(each) * scale[..., None] for each in found)
        return one, other

    return solve(residuals, slopes, common, own, prior_sd, OWN_SD, middle)


def padded(tosses: Sequence[Poses], length: int) -> Seen:
    """The tosses cut or continued (at rest) to the same number of frames."""

    def rows(values: np.ndarray) -> np.ndarray:
        short = max(0, length - len(values))
        return np.pad(values, ((0, short), *[(0, 0)] * (values.ndim - 1)), mode="edge")[:length]

    steps = [
        rows(np.append(np.diff(poses.times_s), np.diff(poses.times_s)[-1])) for poses in tosses
    ]
    return Seen(
        jnp.asarray(np.array(steps)[:, :-1]),
        jnp.asarray(np.array([rows(poses.position_m) for poses in tosses])),
        jnp.asarray(np.array([rows(poses.quaternion) for poses in tosses])),
    )


def starts_of(flights: Sequence[Flight]) -> Start:
    """First guesses, `[toss, ...]`."""
    return Start(*(jnp.asarray([getattr(f, name) for f in flights]) for name in Start._fields))
