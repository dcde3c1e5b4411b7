"""What is on no ramp and no table: falls, flights, springs, liquids and pendulums.

The laws are the effects' (`particle_free.rates`, `particle_pendulum.Pendulum`); integrator and
bounces are SciPy's (Dormand and Prince, order 8, with events), so that a clip is no copy of the
engine that fits it.
"""

import math
from collections.abc import Callable, Mapping
from typing import NamedTuple

import numpy as np
from scipy.integrate import solve_ivp

from galileo_jax.clip.scenarios import SCENARIOS
from galileo_jax.clip.schema import ClipObject
from galileo_jax.model.effects.effect import PENDULUM
from galileo_jax.model.effects.laws.liquid import ADDED_MASS
from galileo_jax.model.effects.laws.pendulum import ANGLE, LENGTH
from galileo_jax.model.effects.laws.start_velocity import PATH, PLANE
from galileo_jax.rollout.motion import dynamics
from galileo_jax.rollout.particle_free import (
    Body,
    floor_of,
    rates,
    rubs,
    slip_rates,
    start_velocity,
)
from galileo_jax.rollout.particle_pendulum import Pendulum, Swing, make_pendulum
from galileo_jax.simulation.hidden import with_given
from galileo_jax.simulation.motion import RECORD_S, Motion
from galileo_jax.simulation.plane import PlaneTruth
from galileo_jax.simulation.solver import PLASTIC_M_S
from galileo_jax.simulation.truth import GRAVITY_M_S2

WATER_KG_M3 = 998.0
DRAG_COEFFICIENT = (0.4, 0.6)  # of a sphere, at Reynolds numbers of 1e3 to 1e5
TOLERANCES, SWING_TOLERANCES = (1e-10, 1e-12), (1e-11, 1e-13)  # relative, absolute
LONGEST_DELAY_S = 0.1

Drawn = tuple[dict[str, float], float, float]  # parameters, height of the start, seconds


def draw_free(
    rng: np.random.Generator, scenario: str, given: Mapping[str, float], has_floor: bool
) -> PlaneTruth:
    """Draws what `given` leaves open.

    Raises:
      InputError: a given name is no parameter of the scenario.
    """
    radius = round(float(rng.uniform(0.015, 0.04)), 3)
    drawn, top_m, seconds = DRAWS[scenario](rng, radius, given)
    values = {"m1": float(np.exp(rng.uniform(np.log(0.05), np.log(0.3)))), **drawn}
    if has_floor:
        values |= {"floor_restitution": rng.uniform(0.5, 0.85), "floor_height": radius}
        seconds = 1.6
        if SCENARIOS[scenario].moves_in_plane:
            values["floor_grip"] = rng.uniform(0.05, 0.35)
    values = with_given(scenario, values, given)
    release = float(rng.uniform(0.0, LONGEST_DELAY_S)) if scenario == "fall" else 0.0
    thing = ClipObject(name="object1", shape="sphere", size_m=(radius,), mass_kg=values["m1"])
    return PlaneTruth(scenario, (thing,), values, ((0.0, top_m),), seconds + release, release)


def _fall(rng: np.random.Generator, radius: float, given: Mapping[str, float]) -> Drawn:
    top = float(rng.uniform(0.8, 2.0))
    return {}, top, math.sqrt(2 * (top - radius) / GRAVITY_M_S2)


def _flight(rng: np.random.Generator, radius: float, given: Mapping[str, float]) -> Drawn:
    speed, angle = rng.uniform(3.0, 6.0), math.radians(rng.uniform(35.0, 75.0))
    x, y = (float(speed * part) for part in (math.cos(angle), math.sin(angle)))
    return dict(zip(PLANE, (x, y), strict=True)), 1.0, 2.2 * y / GRAVITY_M_S2


def _spring(rng: np.random.Generator, radius: float, given: Mapping[str, float]) -> Drawn:
    drawn = {
        "period": rng.uniform(0.4, 1.5),
        "damping": rng.uniform(0.03, 0.5),
        "rest": rng.uniform(0.03, 0.12),
        PATH[0]: rng.uniform(-0.3, 0.3),
    }
    return drawn, 1.0, 3.0


def _liquid(rng: np.random.Generator, radius: float, given: Mapping[str, float]) -> Drawn:
    ratio = float(given.get("density_ratio", rng.uniform(0.1, 0.8)))
    mass = float(given.get("m1", WATER_KG_M3 * 4 / 3 * math.pi * radius**3 / ratio))
    pull = GRAVITY_M_S2 * abs(1 - ratio)
    drag = 0.5 * rng.uniform(*DRAG_COEFFICIENT) * WATER_KG_M3 * math.pi * radius**2
    terminal = math.sqrt(mass * pull / drag)
    drawn = {
        "m1": mass,
        "density_ratio": ratio,
        "liquid_drag": drag,
        PATH[0]: rng.uniform(0.0, 0.3) * math.copysign(1.0, 1 - ratio),
    }
    # Long enough to come near the terminal speed.
    return drawn, 2.5, 4 * terminal * (1 + ADDED_MASS * ratio) / pull + 0.5


def _pendulum(rng: np.random.Generator, radius: float, given: Mapping[str, float]) -> Drawn:
    drawn = {
        LENGTH: rng.uniform(0.3, 1.2),
        ANGLE: rng.uniform(0.3, 1.2) * rng.choice([-1.0, 1.0]),
        PATH[0]: rng.uniform(-0.2, 0.2),
    }
    return {name: float(value) for name, value in drawn.items()}, 1.0, 6.0


DRAWS = {
    "fall": _fall,
    "flight": _flight,
    "spring": _spring,
    "liquid": _liquid,
    "pendulum": _pendulum,
}


def solve_free(truth: PlaneTruth) -> tuple[Motion, tuple[float, ...]]:
    """The motion from the release on, and when it bounces, s."""
    scene = truth.surroundings
    theta, effects = truth.theta, truth.laws
    law = dynamics(effects, scene, theta, np)
    times = RECORD_S * np.arange(round(truth.seconds / RECORD_S) + 2)
    if PENDULUM in scene.laws:
        return _swung(make_pendulum(effects, theta, scene, law), times), ()
    floor = floor_of(effects, theta, scene)
    velocity = start_velocity(effects, theta, scene)
    tangent = np.stack([np.cos(law.ramp_rad), -np.sin(law.ramp_rad)])
    if velocity is None:
        velocity = law.start_speed_m_s[:, None] * tangent
    start = np.array([*truth.start_m[0], *velocity[0], 0.0])

    def slips(t: float, y: np.ndarray, way: float) -> tuple[np.ndarray, float]:
        body = Body(y[:2], y[2:4], y[4])  # pyright: ignore[reportArgumentType]
        changes, excess = slip_rates(body, np.asarray(t), law, scene, way)
        return np.hstack(changes), float(excess)

    def stretch(_: float, state: np.ndarray, is_bounce: bool) -> Stretch:
        now, rests = state.copy(), False
        if floor is not None and is_bounce:
            falling = -now[3]
            rests = falling <= PLASTIC_M_S
            now[1] = floor.height_m + (0.0 if rests else 1e-12)
            now[2] *= 1.0 - float(floor.grip)
            now[3] = 0.0 if rests else float(floor.restitution) * falling

        def change(t: float, y: np.ndarray) -> np.ndarray:
            body = Body(y[:2], y[2:4], y[4])  # pyright: ignore[reportArgumentType]
            return np.hstack(rates(body, np.asarray(t), law, scene, np.asarray(rests)))

        def touch(t: float, y: np.ndarray) -> float:
            return 1.0 if floor is None or rests else float(y[1] - floor.height_m)

        return Stretch(now, change, touch)

    does_rub = rubs(law, scene)
    goes_on = _to_turns(slips, np.array([0, 0, *tangent, 0])) if does_rub else stretch
    rows, _, events = by_events(goes_on, start, times, TOLERANCES)
    bounces = () if does_rub else events
    position, speed = rows[:, :2].T[None], rows[:, 2:4].T[None]
    return Motion(times, position, speed, np.zeros((1, len(times)))), bounces


def _swung(pendulum: Pendulum, times: np.ndarray) -> Motion:
    """The motion of a pendulum, from one turning back to the next."""

    def slips(t: float, y: np.ndarray, way: float) -> tuple[np.ndarray, float]:
        changes, excess = pendulum.rates(Swing(*y), np.asarray(t), way)
        return np.hstack(changes), float(excess)

    def swings_on(_: float, state: np.ndarray, __: bool) -> Stretch:
        return Stretch(state, lambda t, y: slips(t, y, 0.0)[0], lambda t, y: 1.0)

    stretch = _to_turns(slips, np.array([0, 1])) if pendulum.law.rubs else swings_on
    swings, changes, _ = by_events(
        stretch, np.array(pendulum.first, float), times, SWING_TOLERANCES
    )
    seen = [
        pendulum.place(Swing(*swing), change(time, swing)[1])
        for time, swing, change in zip(times, swings, changes, strict=True)
    ]
    position, velocity = (np.array(values).T[None] for values in zip(*seen, strict=True))
    return Motion(times, position, velocity, np.zeros((1, len(times))))


Change = Callable[[float, np.ndarray], np.ndarray]
"""Time and state to the state's rate."""


class Stretch(NamedTuple):
    """How a motion goes on, up to its next event."""

    state: np.ndarray  # where it begins
    change: Change
    # Time and state to what falls through zero at the event
    event: Callable[[float, np.ndarray], float]


def _to_turns(
    slips: Callable[[float, np.ndarray, float], tuple[np.ndarray, float]], along: np.ndarray
) -> Callable[[float, np.ndarray, bool], Stretch]:
    """How what rubs dry goes on to where it turns back, and is held there or not.

    `slips`: time, state and which way it slips (1, -1, 0: not) to the state's rate, and to by how
    much the pull exceeds what friction holds. `along`: its product with a state is the speed.
    """

    def stretch(began: float, state: np.ndarray, is_turned: bool) -> Stretch:
        now = state * (along == 0) if is_turned else state
        pulled, excess = slips(began, now, 0.0)
        starts = float(np.sign(pulled @ along)) if excess > 0 else 0.0
        way = float(np.sign(now @ along)) or starts

        def turn(t: float, y: np.ndarray) -> float:
            return float(y @ along) * way if way and t > began else 1.0

        return Stretch(now, lambda t, y: abs(way) * slips(t, y, way)[0], turn)

    return stretch


def by_events(
    stretch: Callable[[float, np.ndarray, bool], Stretch],
    state: np.ndarray,
    times_s: np.ndarray,
    tolerances: tuple[float, float],
) -> tuple[np.ndarray, list[Change], tuple[float, ...]]:
    """The motion at some times, from event to event (Dormand and Prince, order 8).

    `stretch`: of time, state, and whether an event is there, which it carries out. `state`: at the
    first of the times. `tolerances`: relative, absolute.

    Returns:
      states `[time, number]`, what moved it at each time, and when there was an event, s.
    """
    states, changes, events = np.empty((len(times_s), len(state))), [], []
    begin, time = 0, float(times_s[0])
    while begin < len(times_s):
        begins, change, event = stretch(time, state, bool(events))
        event.terminal, event.direction = True, -1.0  # pyright: ignore[reportFunctionMemberAccess]
        found = solve_ivp(
            change,
            (time, times_s[-1]),
            begins,
            method="DOP853",
            dense_output=True,
            events=event,
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
    return states, changes, tuple(events)
