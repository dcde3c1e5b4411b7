"""From one event to the next by SciPy's integrator, which shares nothing with the engines."""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from scipy.integrate import solve_ivp


class Stretch(NamedTuple):
    """What happens up to an event, or to the end.

    Attributes:
      rows: `[k, number]`, the states at the next k times.
      time_s, state: of the event.
      is_event: not the end.
    """

    rows: np.ndarray
    time_s: float
    state: np.ndarray
    is_event: bool


def to_event(
    change: Callable[[float, np.ndarray], np.ndarray],
    event: Callable[[float, np.ndarray], float],
    time_s: float,
    state: np.ndarray,
    times_s: np.ndarray,
    tolerances: tuple[float, float],
) -> Stretch:
    """Integrates until `event` falls through zero.

    Args:
      change: the state's rate.
      event: of time and state.
      time_s: where it begins.
      state: where it begins.
      times_s: `[frame]`, those at which the state is still wanted.
      tolerances: relative, absolute.
    """

    def falls(t: float, y: np.ndarray) -> float:
        return event(t, y)

    falls.terminal, falls.direction = True, -1.0  # pyright: ignore[reportFunctionMemberAccess]
    found = solve_ivp(
        change,
        (time_s, times_s[-1]),
        state,
        method="DOP853",
        dense_output=True,
        events=falls,
        rtol=tolerances[0],
        atol=tolerances[1],
    )
    count = int(np.searchsorted(times_s, found.t[-1] + 1e-12))
    rows = found.sol(times_s[:count]).T
    return Stretch(rows, float(found.t[-1]), found.y[:, -1].copy(), found.status == 1)
