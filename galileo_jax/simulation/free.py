"""What is not on a ramp: falls, flights, springs, liquids and pendulums with known truth.

The laws are the effects' (`rollout/particle_free.rates`); integrator and bounces are SciPy's
(Dormand and Prince, order 8, with events), so that a clip is no copy of the engine that fits it.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import TypeVar

import numpy as np

from galileo_jax.clip.scenarios import SCENARIOS
from galileo_jax.clip.schema import ClipObject
from galileo_jax.model.effects.air import expected_added_mass
from galileo_jax.model.effects.effect import PENDULUM, Effect, Surroundings
from galileo_jax.model.effects.laws import LAWS
from galileo_jax.model.effects.laws.liquid import ADDED_MASS
from galileo_jax.model.effects.laws.pendulum import ANGLE, LENGTH
from galileo_jax.model.effects.laws.start_velocity import PATH, PLANE
from galileo_jax.model.parameters import Parameter
from galileo_jax.model.scene.scene import extents
from galileo_jax.rollout.motion import dynamics
from galileo_jax.rollout.particle_free import (
    Body,
    floor_of,
    rates,
    start_velocity,
)
from galileo_jax.runtime.errors import InputError
from galileo_jax.simulation.hidden import Hidden, check_parameters, prior_value, with_given
from galileo_jax.simulation.level import LevelTruth
from galileo_jax.simulation.motion import RECORD_S, Motion
from galileo_jax.simulation.pendulum import swung
from galileo_jax.simulation.solver import PLASTIC_M_S
from galileo_jax.simulation.to_event import Stretch, by_events
from galileo_jax.simulation.truth import DECLARED_WRONGLY, GRAVITY_M_S2

WATER_KG_M3 = 998.0
DRAG_COEFFICIENT = (0.4, 0.6)  # of a sphere, at Reynolds numbers of 1e3 to 1e5
TOLERANCES = (1e-10, 1e-12)  # relative, absolute
LONGEST_DELAY_S = 0.1
# From weak to strong, in z: what a prior holds for likely.
WEAK_Z, STRONG_Z = -0.5, 1.0


@dataclass(frozen=True)
class FreeTruth:
    """One object that slides on nothing.

    Attributes:
      scenario: its name.
      thing: name, shape, size and mass.
      values: every parameter by name, those of `effects` too.
      start_m: the centre at the start, (x, y).
      seconds: how long it is looked at.
      release_s: a fall is let go so long after the first frame.
      effects: what is hidden in the clip.
    """

    scenario: str
    thing: ClipObject
    values: Mapping[str, float]
    start_m: tuple[float, float]
    seconds: float
    release_s: float = 0.0
    gravity: float = GRAVITY_M_S2
    effects: tuple[Effect, ...] = field(default=())

    @property
    def surroundings(self) -> Surroundings:
        """The scene as the laws see it."""
        scenario = SCENARIOS[self.scenario]
        half_length, half_height = extents(self.thing)
        has_floor = "floor_restitution" in self.values
        return Surroundings(
            names=(self.thing.name,),
            angle_rad=0.0 if scenario.moves_in_plane else math.pi / 2,
            gravity=self.gravity,
            half_length_m=(half_length,),
            half_height_m=(half_height,),
            corner_m=(math.inf,),
            start_m=(self.start_m,),
            start_path_m=(0.0,),
            has_table=False,
            comes_down=(False,),
            has_surface=False,
            moves_in_plane=scenario.moves_in_plane,
            laws=(*scenario.laws, *(("floor",) if has_floor else ())),
            expected=dict.fromkeys(NAMES, (0.0, 1.0)) | self._carried_air,
        )

    @property
    def _carried_air(self) -> dict[str, tuple]:
        """As the clip's yaml, with size and mass, will tell it; of a ball in a liquid nothing."""
        size_m = self.thing.size_m
        if self.scenario == "liquid" or size_m is None:
            return {}
        return expected_added_mass(size_m[0], self.values["m1"])


NAMES = (*PLANE, *PATH, LENGTH, ANGLE, "rest", "period", "density_ratio", "floor_height")


def draw_free(
    rng: np.random.Generator, scenario: str, given: Mapping[str, float], has_floor: bool
) -> FreeTruth:
    """Draws what `given` leaves open.

    Raises:
      InputError: a given name is no parameter of the scenario, or it can have no floor.
    """
    if has_floor and "floor" not in SCENARIOS[scenario].keys:
        raise InputError(f"--floor: there is none in scenario {scenario}")
    draw = DRAWS[scenario]
    radius = round(float(rng.uniform(0.015, 0.04)), 3)
    drawn, top_m, seconds = draw(rng, radius, given)
    values = {"m1": float(np.exp(rng.uniform(np.log(0.05), np.log(0.3)))), **drawn}
    if has_floor:
        values |= {"floor_restitution": rng.uniform(0.5, 0.85), "floor_height": radius}
        seconds = 1.6
        if SCENARIOS[scenario].moves_in_plane:
            values["floor_grip"] = rng.uniform(0.05, 0.35)
    values = with_given(scenario, values, given)
    release = float(rng.uniform(0.0, LONGEST_DELAY_S)) if scenario == "fall" else 0.0
    thing = ClipObject(name="object1", shape="sphere", size_m=(radius,), mass_kg=values["m1"])
    return FreeTruth(scenario, thing, values, (0.0, top_m), seconds + release, release)


Truth = TypeVar("Truth", FreeTruth, LevelTruth)
Drawn = tuple[dict[str, float], float, float]  # parameters, height of the start, seconds


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


def hide_free(truth: Truth, hidden: Hidden, rng: np.random.Generator) -> Truth:
    """Puts an effect into a truth; what is not given is drawn from its prior.

    A strength from 0 (weak) to 1 (strong) says where in the prior the first parameter is.

    Raises:
      InputError: the effect has no place in the scenario, or no such parameter.
    """
    effect, given, strength = hidden
    parameters = effect.parameters(truth.surroundings)
    if effect.name in SCENARIOS[truth.scenario].without or not parameters:
        raise InputError(f"--effect: {effect.name} has no place in scenario {truth.scenario}")
    check_parameters(effect, given, parameters)
    share = {parameters[0].name: strength}
    drawn = {p.name: given.get(p.name, _drawn(p, rng, share.get(p.name))) for p in parameters}
    return replace(truth, values={**truth.values, **drawn}, effects=(*truth.effects, effect))


def _drawn(parameter: Parameter, rng: np.random.Generator, share: float | None) -> float:
    """From weak (share 0) to strong (1) in the prior; None draws the share."""
    z = rng.uniform(WEAK_Z, STRONG_Z)
    if share is not None:
        z = WEAK_Z + share * (STRONG_Z - WEAK_Z)
    return prior_value(parameter, z)


def solve_free(truth: FreeTruth) -> tuple[Motion, tuple[float, ...]]:
    """The motion from the release on, and when it bounces, s."""
    scene = truth.surroundings
    theta = {name: np.asarray(value) for name, value in truth.values.items()}
    effects = (*(e for e in truth.effects if e.name not in DECLARED_WRONGLY), *LAWS)
    if PENDULUM in scene.laws:
        return swung(effects, theta, scene, truth.seconds), ()
    law = dynamics(effects, scene, theta, np)
    floor = floor_of(effects, theta, scene)
    velocity = start_velocity(effects, theta, scene)
    if velocity is None:
        tangent = np.stack([np.cos(law.ramp_rad), -np.sin(law.ramp_rad)])
        velocity = law.start_speed_m_s[:, None] * tangent
    times = RECORD_S * np.arange(round(truth.seconds / RECORD_S) + 2)

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

    start = np.array([*truth.start_m, *velocity[0], 0.0])
    rows, _, bounces = by_events(stretch, start, times, TOLERANCES)
    position, speed = rows[:, :2].T[None], rows[:, 2:4].T[None]
    return Motion(times, position, speed, np.zeros((1, len(times)))), bounces
