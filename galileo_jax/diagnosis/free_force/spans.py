"""When objects move: the pieces of time in which a free acceleration is looked for."""

import numpy as np

from galileo_jax.inference.problem import Problem
from galileo_jax.model.effects.free_acceleration import Span

MOVES_M_S = 0.01
LONGER = 1.05  # than the hypothesis says, the objects may move
SHORTEST_S = 0.05  # of a piece


def spans_of(problem: Problem, theta: np.ndarray) -> tuple[tuple[Span, ...], ...]:
    """When each object moves by a rollout, in pieces; all the time where it says never.

    Object 1 has a piece on the ramp, one on the table, and one from when object 2 begins to
    move.
    """
    last = float(problem.observation.times_s[-1])
    position, velocity = problem.engine.simulate(theta[None])
    times = np.arange(velocity.shape[-1]) * problem.model.record_dt_s
    scene = problem.model.scene.surroundings
    speeds = np.linalg.norm(velocity[0], axis=1)
    moved = np.linalg.norm(position[0] - position[0, ..., :1], axis=1)
    found = []
    for way, speed in zip(moved, speeds, strict=True):
        moving = np.flatnonzero((speed > MOVES_M_S) & (times <= last))
        begin, end = (moving[0], moving[-1]) if moving.size > 2 else (0, len(times) - 1)
        # Records are 4 ms apart; a knock is in between.
        since = min(way[begin] / max(speed[begin], MOVES_M_S), times[1])
        start = max(float(times[begin] - since), 0.0)
        found.append((start, float(min(last, start + LONGER * (times[end] - start)))))
    (begin, end), *others = found
    events = [start for start, _ in others]
    beyond = position[0, 0, 0] - scene.corner_m[0]
    if scene.comes_down[0] and (beyond >= 0).any():
        events.append(float(_first_s(beyond, times)))
    edges = [begin]
    for event in sorted(events):
        if event > edges[-1] + SHORTEST_S and end > event + SHORTEST_S:
            edges.append(event)
    pieces = tuple(zip(edges, [*edges[1:], end], strict=True))
    return (pieces, *((span,) for span in others))


def _first_s(value: np.ndarray, times_s: np.ndarray) -> float:
    """When `value` `[time]` first reaches zero."""
    reached = int(np.argmax(value >= 0))
    pair = slice(max(reached - 1, 0), reached + 1)
    return float(np.interp(0.0, value[pair], times_s[pair]))
