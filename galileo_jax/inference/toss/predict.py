"""The rest of a toss from its beginning, with what other tosses told of box and table."""

from collections.abc import Sequence
from dataclasses import dataclass

import jax.numpy as jnp
import numpy as np

from galileo_jax.inference.toss.fit import (
    PRIOR_SD,
    left_of_all,
    padded,
    solve_window,
    starts_of,
    with_flights,
)
from galileo_jax.inference.toss.residuals import EDGE, forward
from galileo_jax.observation.poses import Poses

KNOWN = 1e-4  # of the prior's widths: what other tosses told stays


@dataclass(frozen=True)
class Ahead:
    """How far the predicted rest of each toss is from the measured one; means over its frames."""

    names: tuple[str, ...]  # of the tosses
    place: np.ndarray  # `[toss]`, distance of the centres over the edge
    turn_rad: np.ndarray  # `[toss]`, angle of the turning between predicted and measured


def predict_rest(
    tosses: Sequence[Poses], common: np.ndarray, edge_m: float, share: float = 0.5
) -> Ahead:
    """Fits the start of each toss to the first `share` of it, and compares the rest.

    `common`: what all share, in the space of the search (`Solution.common`). `edge_m`: as declared.
    `share`: of the frames, that are seen.
    """
    kept = with_flights(tosses, edge_m)
    poses = [one for one, _ in kept]
    start = starts_of([flight for _, flight in kept])
    lengths = np.array([len(one.times_s) for one in poses])
    until = np.round(share * lengths).astype(int)
    own = np.zeros((len(kept), 12))
    seen = padded(poses, int(lengths.max()))
    flown = [flight.last + 4 for _, flight in kept]
    for stage in (np.minimum(flown, until), until):
        found = solve_window(seen, start, list(stage), common, own, common, KNOWN * PRIOR_SD)
        own = found.own
    left = np.asarray(left_of_all(jnp.asarray(common), jnp.asarray(own), start, seen))
    edge = float(forward(jnp.asarray(common))[EDGE])
    place, turn = [], []
    for one, begin, end in zip(left, until, lengths, strict=True):
        place.append(np.linalg.norm(one[begin:end, :3], axis=1).mean() / edge)
        turn.append(np.linalg.norm(one[begin:end, 3:], axis=1).mean())
    return Ahead(tuple(one.name for one in poses), np.array(place), np.array(turn))
