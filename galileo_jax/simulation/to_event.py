"""From one event to the next by SciPy's integrator, which shares nothing with the engines."""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from scipy.integrate import solve_ivp


class Stretch(NamedTuple):
    """How a motion goes on, up to its next event.

    Attributes:
      state: where it begins.
      change: time and state to the state's rate.
      event: time and state to what falls through zero at the event.
    """

    state: np.ndarray
    change: Callable[[float, np.ndarray], np.ndarray]
    event: Callable[[float, np.ndarray], float]


class Integrated(NamedTuple):
    """A motion.

    Attributes:
      states: `[time, number]`.
      changes: `[time]`, what moved it then, as of `Stretch`.
      events_s: when there was an event.
    """

    states: np.ndarray
    changes: list[Callable[[float, np.ndarray], np.ndarray]]
    events_s: tuple[float, ...]


def by_events(
    stretch: Callable[[float, np.ndarray, bool], Stretch],
    state: np.ndarray,
    times_s: np.ndarray,
    tolerances: tuple[float, float],
) -> Integrated:
    """The motion at some times, from event to event (Dormand and Prince, order 8).

    Args:
      stretch: of time, state, and whether an event is there, which it carries out.
      state: at the first of the times.
      times_s: `[time]`.
      tolerances: relative, absolute.
    """
    states, changes, events = np.empty((len(times_s), len(state))), [], []
    begin, time = 0, float(times_s[0])
    while begin < len(times_s):
        begins, change, event = stretch(time, state, bool(events))

        def falls(t: float, y: np.ndarray, event=event) -> float:
            return event(t, y)

        falls.terminal, falls.direction = True, -1.0  # pyright: ignore[reportFunctionMemberAccess]
        found = solve_ivp(
            change,
            (time, times_s[-1]),
            begins,
            method="DOP853",
            dense_output=True,
            events=falls,
            rtol=tolerances[0],
            atol=tolerances[1],
        )
        until = int(np.searchsorted(times_s, found.t[-1] + 1e-12))
        states[begin:until] = found.sol(times_s[begin:until]).T
        changes += [change] * (until - begin)
        begin, time, state = until, float(found.t[-1]), found.y[:, -1]
        if found.status != 1:
            break
        events.append(time)
    return Integrated(states, changes, tuple(events))
