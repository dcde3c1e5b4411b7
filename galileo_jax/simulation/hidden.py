"""Hiding an effect in a truth: how strong it is made where nobody says."""

import math
from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from types import MappingProxyType
from typing import NamedTuple

import jax
import numpy as np

from galileo_jax.model.effects.effect import Effect
from galileo_jax.model.effects.registry import load_file, make_effects
from galileo_jax.model.parameters import Parameter
from galileo_jax.runtime.errors import InputError
from galileo_jax.simulation.truth import Truth


class Range(NamedTuple):
    """From weak to strong."""

    weak: float  # sizes; between them on a logarithmic scale
    strong: float
    is_signed: bool = False  # whether either sign is as likely
    # Whether it is times object 1's mass: a force that gives an acceleration
    is_per_mass: bool = False


# On a ramp of 10 to 20 degrees, followed to 0.3 px at 900 px/m, many weak ones
# hide behind friction and nuisances; the exam counts those that show.
STRENGTHS = {
    "air_drag": Range(0.4, 2.0, is_per_mass=True),
    "constant_force": Range(0.5, 1.5, is_signed=True, is_per_mass=True),
    "frame_rate": Range(0.03, 0.10, is_signed=True),
    "friction_patch": Range(0.12, 0.40),
    "initial_push": Range(0.15, 0.60),
    "magnetic_brake": Range(1.5, 6.0, is_per_mass=True),
    "ramp_angle": Range(math.radians(1.0), math.radians(2.5), is_signed=True),
    "release_delay": Range(0.08, 0.40),
    "restitution": Range(0.20, 0.80),
    "rolling": Range(0.30, 1.00),
    "scale_error": Range(0.03, 0.10, is_signed=True),
    "spring_tether": Range(0.5, 2.5, is_per_mass=True),
    "stribeck": Range(0.7, 2.5),
    "surface_friction": Range(0.08, 0.30),
    "table_tilt": Range(math.radians(0.8), math.radians(2.5), is_signed=True),
    "viscous_drag": Range(0.3, 1.5, is_per_mass=True),
}
OTHERS = {
    "friction_patch_edge": Range(0.005, 0.02),
    "friction_patch_length": Range(0.08, 0.20),
    "magnetic_brake_edge": Range(0.005, 0.02),
    "magnetic_brake_length": Range(0.08, 0.20),
    "spring_tether_straightness": Range(1.0, 1.0),  # a free band
    "stribeck_speed": Range(0.2, 0.6),
}
START = "_start"
FREE_WAY_M = 0.03  # between a zone and the start or object 2
STARTS_AT_ALL = Range(0.02, 0.002)  # tan a - k that static friction leaves, from weak to strong


class Hidden(NamedTuple):
    """An effect to hide."""

    effect: Effect  # the effect
    # Values of its parameters; what is missing is drawn
    given: Mapping[str, float] = MappingProxyType({})
    strength: float | None = None  # 0 (weak) to 1 (strong); None draws it


def make_hidden(
    effects: Mapping[str, Mapping[str, float]],
    strength: float | None = None,
    effects_from: Sequence[str | Path] = (),
) -> list[Hidden]:
    """The effects of these names, each with its given values, in alphabetical order.

    Raises:
      InputError: a name is unknown, or a file registers no effect.
    """
    for path in effects_from:
        load_file(path)
    return [Hidden(each, effects[each.name], strength) for each in make_effects(list(effects))]


def prior_value(parameter: Parameter, z: float) -> float:
    """The parameter at `z` of its prior; always in single precision, as the first clips were.

    A seed so makes the same clip to the last digit, whatever precision the caller has set.
    """
    with jax.enable_x64(False):
        return float(parameter.prior.forward(np.asarray(z)))  # pyright: ignore[reportArgumentType]


def check_given(option: str, owner: str, given: Iterable[str], known: Collection[str]) -> None:
    """Raises `InputError` where a given name is none of the owner's parameters."""
    for name in given:
        if name not in known:
            listed = ", ".join(known)
            raise InputError(f"{option}: {owner} has no parameter {name!r}; known: {listed}")


def with_given(
    scenario: str, drawn: Mapping[str, float], given: Mapping[str, float]
) -> dict[str, float]:
    """What was drawn, with given values in its place.

    Raises:
      InputError: a given name is no parameter of the scenario.
    """
    check_given("--set", scenario, given, drawn)
    return {name: float(given.get(name, value)) for name, value in drawn.items()}


def hide(truth: Truth, hidden: Hidden, rng: np.random.Generator) -> Truth:
    """Puts an effect into a truth; an error of the declared angle makes its ramp steeper.

    Raises:
      InputError: a given name is not the effect's, or the effect has no place in the scene.
    """
    effect, given, strength = hidden
    parameters = effect.parameters(truth.surroundings)
    names = [parameter.name for parameter in parameters]
    if not names:
        raise InputError(f"--effect: {effect.name} has no place in this scene")
    check_given("--effect", effect.name, given, names)
    share = float(rng.uniform()) if strength is None else strength
    values: dict[str, float] = {}
    # A zone's start is drawn last: its length has to fit in.
    for parameter in sorted(parameters, key=lambda p: p.name.endswith(START)):
        drawn = _draw(parameter, names[0], share, truth, {**values, **given}, rng)
        values[parameter.name] = given.get(parameter.name, drawn)
    steeper_deg = math.degrees(values.get("ramp_angle", 0.0))
    return replace(
        truth,
        ramp_angle_deg=truth.ramp_angle_deg + steeper_deg,
        effects=(*truth.effects, effect),
        effect_values={**truth.effect_values, **{name: values[name] for name in names}},
    )


def _draw(
    parameter: Parameter,
    strength_name: str,
    share: float,
    truth: Truth,
    drawn: Mapping[str, float],
    rng: np.random.Generator,
) -> float:
    name = parameter.name
    if name == "static_friction":
        left = _between(STARTS_AT_ALL, share)
        return max(0.01, math.tan(truth.angle_rad) - truth.friction[0] - left)
    if name in STRENGTHS or name in OTHERS:
        wanted = STRENGTHS.get(name) or OTHERS[name]
        value = _between(wanted, share if name == strength_name else float(rng.uniform()))
        sign = rng.choice([-1.0, 1.0]) if wanted.is_signed else 1.0
        return float(sign * value * (truth.mass_kg[0] if wanted.is_per_mass else 1.0))
    if name.endswith(START):
        where = truth.surroundings
        low = where.start_path_m[0] + FREE_WAY_M
        length = drawn.get(f"{name.removesuffix(START)}_length", 0.0)
        way = truth.release_m
        if len(truth.objects) > 1:
            way = where.start_path_m[1] - sum(where.half_length_m[:2])
        high = way - length - FREE_WAY_M
        return float(rng.uniform(low, max(low, high)))
    # One that somebody added: what its prior holds for likely, away from the middle.
    z = (0.3 + 1.2 * share) if name == strength_name else rng.uniform(-1.0, 1.0)
    return prior_value(parameter, z)


def _between(wanted: Range, share: float) -> float:
    return wanted.weak * (wanted.strong / wanted.weak) ** share
