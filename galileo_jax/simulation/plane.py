"""What is on no ramp, with known truth: one object that falls, flies or hangs, or pucks."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from galileo_jax.clip.scenarios import SCENARIOS
from galileo_jax.clip.schema import ClipObject
from galileo_jax.clip.sizes import extents
from galileo_jax.model.effects.air import expected_added_mass
from galileo_jax.model.effects.effect import Effect, Surroundings
from galileo_jax.model.effects.laws import LAWS
from galileo_jax.model.effects.laws.pendulum import ANGLE, LENGTH
from galileo_jax.model.effects.laws.pucks import OFFSET, START
from galileo_jax.model.effects.laws.start_velocity import PATH, PLANE
from galileo_jax.model.parameters import Parameter
from galileo_jax.model.scene.scene import laid_out
from galileo_jax.runtime.errors import InputError
from galileo_jax.simulation.hidden import Hidden, check_given, prior_value
from galileo_jax.simulation.truth import DECLARED_WRONGLY, GRAVITY_M_S2, Declared

Point = tuple[float, float]
# What a prior would be told of; any numbers do.
ON_THE_TABLE = (*(f"{name}1" for name in START), OFFSET)
ELSEWHERE = (*PLANE, *PATH, LENGTH, ANGLE, "rest", "period", "density_ratio", "floor_height")
# From weak to strong, in z: what a prior holds for likely.
WEAK_Z, STRONG_Z = -0.5, 1.0


@dataclass(frozen=True)
class PlaneTruth:
    """One experiment."""

    scenario: str  # its name
    things: tuple[ClipObject, ...]  # names, shapes, sizes and masses
    values: Mapping[str, float]  # every parameter by name, those of `effects` too
    start_m: tuple[Point, ...]  # `[object]`, (x, y) of the centres at the start
    seconds: float = math.inf  # how long it is looked at, at most
    release_s: float = 0.0  # a fall is let go so long after the first frame
    effects: tuple[Effect, ...] = ()  # what is hidden in the clip
    walls_m: tuple[tuple[Point, Point], ...] = ()  # the ends of every wall
    gravity: float = GRAVITY_M_S2

    def declared(self, fps: float) -> Declared:
        """What is said of it, filmed at what is said to be `fps`."""
        return Declared.of(self.values, fps, release_s=self.release_s)

    @property
    def theta(self) -> dict[str, Any]:
        """All parameters by name, for the laws."""
        return {name: np.asarray(value) for name, value in self.values.items()}

    @property
    def laws(self) -> tuple[Effect, ...]:
        """What acts in the motion."""
        return (*(e for e in self.effects if e.name not in DECLARED_WRONGLY), *LAWS)

    @property
    def surroundings(self) -> Surroundings:
        """The scene as the laws see it."""
        scenario = SCENARIOS[self.scenario]
        half = [extents(thing) for thing in self.things]
        start = self.start_m
        if scenario.is_level:  # seen from above both are the radius
            half = [(radius, radius) for radius, _ in half]
            start = tuple((*at, 0.0) for at in start)
        angle = 0.0 if scenario.moves_in_plane else math.pi / 2
        declared = (("floor", "floor_restitution" in self.values), ("walls", bool(self.walls_m)))
        size_m, expected = self.things[0].size_m, ELSEWHERE
        air = {}
        if scenario.is_level:
            expected = ON_THE_TABLE
        elif self.scenario != "liquid" and size_m is not None:
            # As the clip's yaml, with size and mass, will tell it.
            air = expected_added_mass(size_m[0], self.values["m1"])
        return Surroundings(
            names=tuple(thing.name for thing in self.things),
            angle_rad=angle,
            gravity=self.gravity,
            **laid_out(half, start, angle, has_table=False),
            has_surface=scenario.is_level,
            moves_in_plane=scenario.moves_in_plane,
            laws=scenario.laws + tuple(name for name, is_there in declared if is_there),
            expected=dict.fromkeys(expected, (0.0, 1.0)) | air,
            walls_m=self.walls_m,
        )


def hide_in_plane(truth: PlaneTruth, hidden: Hidden, rng: np.random.Generator) -> PlaneTruth:
    """Puts an effect into a truth; what is not given is drawn from its prior.

    A strength from 0 (weak) to 1 (strong) says where in the prior the first parameter is.

    Raises:
      InputError: the effect has no place in the scenario, or no such parameter.
    """
    effect, given, strength = hidden
    parameters = effect.parameters(truth.surroundings)
    if effect.name in SCENARIOS[truth.scenario].without or not parameters:
        raise InputError(f"--effect: {effect.name} has no place in scenario {truth.scenario}")
    check_given("--effect", effect.name, given, [parameter.name for parameter in parameters])
    share = {parameters[0].name: strength}
    drawn = {p.name: given.get(p.name, _drawn(p, rng, share.get(p.name))) for p in parameters}
    return replace(truth, values={**truth.values, **drawn}, effects=(*truth.effects, effect))


def _drawn(parameter: Parameter, rng: np.random.Generator, share: float | None) -> float:
    """From weak (share 0) to strong (1) in the prior; None draws the share."""
    z = rng.uniform(WEAK_Z, STRONG_Z)
    if share is not None:
        z = WEAK_Z + share * (STRONG_Z - WEAK_Z)
    return prior_value(parameter, z)
