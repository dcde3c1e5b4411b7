"""What all engines share: what the parameters and effects make of the scene; path and plane.

Written in the array standard, so that the same lines run in NumPy (C engine) and in JAX.
"""

import dataclasses
import functools
from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple

import jax
from jaxtyping import Bool, Float

from galileo_jax.model.effects.effect import (
    Effect,
    Force,
    Friction,
    Push,
    State,
    Surroundings,
    true_surroundings,
)

# NumPy or JAX arrays alike; the leading axes are the batch's.
Array = Float[Any, "..."]
PerObject = Float[Any, "... object"]
OfCentres = Float[Any, "... object 2"]

# MuJoCo's own least (mjMINMU); MJX does not keep to it, and at 0 its elliptic cone sticks.
LEAST_FRICTION = 1e-5


class Dynamics(NamedTuple):
    """The equations of motion along the path, for given parameters; leading axes `[...]`.

        inertia * acceleration = drive - sign(slip) * brake
        rim's acceleration     = rim * sign(slip) * brake,           slip = speed - rim's speed

    or, while less than the brake keeps the slip at 0, with so much of it. What does not roll has
    rim = 0: its slip is its speed, and without slip it rests.
    """

    mass: PerObject  # kg
    inertia: PerObject  # kg; the mass, and what turns with it
    # `[..., object]`, 1 / (beta m), 1/kg, of what rolls: how friction turns it; 0 of others
    rim: PerObject
    friction: PerObject  # the constant coefficients that effects start from
    start_m: PerObject  # at the release
    start_speed_m_s: PerObject
    ramp_rad: Array  # `[...]`, true slopes
    table_rad: Array
    # Cos and sin, each `[...]`, of the angle by which the path turns at the foot
    turn: tuple[Array, Array]
    foot: Array  # `[...]`, factor on the speed kept at the foot
    restitution: Array  # `[...]`, between objects
    # `[..., object]`, kg; as inertia, and by how much of its momentum each hit passes on (the rigid
    # engine; MuJoCo's hits conserve it)
    at_hits: PerObject
    # `[...]`, how much further apart neighbours touch again once they have met (the rigid engine;
    # MuJoCo's contacts give way by themselves)
    overlap_m: Array
    coefficient: Callable[[State], PerObject]  # `State` to friction coefficients `[..., object]`
    # `State` to forces along the path but friction, `[..., object]`, N
    drive: Callable[[State], PerObject]
    brake: Callable[[State], PerObject]  # `State` to friction's size `[..., object]`, N
    gravity: Array  # `[...]` or a number, m/s^2
    is_steady: bool  # whether drive and brake are constant on either side of the foot
    rubs: bool  # whether a law of friction may act
    # Forces with directions of their own on one free body, see `Effect.push`
    pushes: tuple[Push, ...] = ()


def dynamics(
    effects: Sequence[Effect],
    scene: Surroundings,
    theta: Mapping[str, Array],
    xp: Any,
    acts: Bool[Any, " effect"] | None = None,
) -> Dynamics:
    """Puts parameters (each `[...]`) and the effects that may act together.

    `acts`, in JAX: forces and friction laws of others are not computed at all, where the same
    holds for all of a batch. None: all act.
    """
    scene = true_surroundings(effects, theta, scene)
    mass = xp.stack(scene.mass(theta), axis=-1)
    friction = xp.zeros(mass.shape)
    if scene.has_surface:
        given = [theta[f"k{i + 1}"] for i in range(len(scene.names))]
        friction = xp.maximum(xp.stack(given, axis=-1), LEAST_FRICTION)
    lead = mass.shape[:-1]
    start = xp.broadcast_to(xp.asarray(scene.start_path_m), mass.shape)
    for effect in effects:
        start = effect.start(start, theta, scene)
    share = total([e.inertia(theta, scene) for e in effects])
    ramp, table, foot = scene.angle_rad + xp.zeros(lead), xp.zeros(lead), xp.ones(lead)
    for effect in effects:
        if (tilt := effect.tilt(theta, scene)) is not None:
            ramp, table = ramp + tilt[0], table + tilt[1]
        if (factor := effect.foot(theta, scene)) is not None:
            foot = foot * factor
    laws = _acting([e.friction(theta, scene) for e in effects], acts)
    adds = _acting([_added(e.force(theta, scene)) for e in effects], acts)
    coefficient, drive, brake = _forces(laws, adds, friction, mass, (ramp, table), scene)
    inertia = mass if share is None else mass * (1.0 + share)
    return Dynamics(
        mass=mass,
        inertia=inertia,
        rim=_rim(mass, scene),
        friction=friction,
        start_m=start,
        start_speed_m_s=total([e.start_speed(theta, scene) for e in effects], xp.zeros(mass.shape)),
        ramp_rad=ramp,
        table_rad=table,
        turn=(xp.cos(ramp - table), xp.sin(ramp - table)),
        foot=foot,
        restitution=total([e.restitution(theta, scene) for e in effects], xp.zeros(lead)),
        at_hits=_at_hits(inertia, [e.passed_on(theta, scene) for e in effects]),
        overlap_m=total([e.overlap(theta, scene) for e in effects], xp.zeros(lead)),
        coefficient=coefficient,
        drive=drive,
        brake=brake,
        gravity=scene.gravity,
        is_steady=not laws and not adds,
        rubs=bool(laws),
        pushes=tuple(push for e in effects if (push := e.push(theta, scene)) is not None),
    )


def _at_hits(inertia: PerObject, factors: Sequence[tuple[Array, ...] | None]) -> PerObject:
    """What inertias look like in hits: each front body's is divided by the factors up to it."""
    xp = inertia.__array_namespace__()
    for each in factors:
        if each is not None:
            passed = xp.stack([xp.ones_like(each[0]), *each], axis=-1)
            inertia = inertia / xp.cumulative_prod(passed, axis=-1)
    return inertia


def _forces(
    laws: Sequence[Friction],
    adds: Sequence[Friction],
    friction: PerObject,
    mass: PerObject,
    slopes_rad: tuple[Array, Array],
    scene: Surroundings,
) -> tuple[Force, Force, Force]:
    """Coefficient, drive and brake, as `Dynamics` has them."""
    xp = mass.__array_namespace__()
    # Once for each rollout: its loop has no need of sines.
    weight = mass * xp.asarray(scene.gravity)[..., None]
    slopes = [slope[..., None] for slope in slopes_rad]
    # In the plane gravity has a direction of its own and is no force along the path.
    pulls = [weight * (0.0 if scene.moves_in_plane else xp.sin(slope)) for slope in slopes]
    normals = [weight * xp.cos(slope) for slope in slopes]

    def coefficient(state: State) -> PerObject:
        return functools.reduce(lambda k, law: law(state, k), laws, friction)

    def drive(state: State) -> PerObject:
        pull = xp.where(state.is_on_ramp, *pulls)
        return functools.reduce(lambda sum_, add: add(state, sum_), adds, pull)

    def brake(state: State) -> PerObject:
        return coefficient(state) * xp.where(state.is_on_ramp, *normals)

    return coefficient, drive, brake


def _added(force: Force | None) -> Friction | None:
    """A force as what it makes of the sum of those before it."""
    return None if force is None else lambda state, total: total + force(state)


def _acting(laws: Sequence[Friction | None], acts: Bool[Any, " effect"] | None) -> list[Friction]:
    """The laws that there are, of each effect one, each left out where its effect does not act."""
    if acts is None:
        return [law for law in laws if law is not None]

    def if_acts(i: int, law: Friction) -> Friction:
        return lambda state, value: jax.lax.cond(
            acts[i], lambda value: law(state, value), lambda value: value, value
        )

    return [if_acts(i, law) for i, law in enumerate(laws) if law is not None]


def _rim(mass: PerObject, scene: Surroundings) -> PerObject:
    xp = mass.__array_namespace__()
    if not any(scene.rolls):
        return xp.zeros(mass.shape)
    rolls = xp.asarray(scene.rolls)
    return rolls / (xp.where(rolls, xp.asarray(scene.roll_inertia), 1.0) * mass)


def state_at(path_m: PerObject, speed_m_s: PerObject, time_s: Array, scene: Surroundings) -> State:
    """The state with what follows from the scene."""
    is_on_ramp = path_m < 0 if scene.has_table else path_m == path_m
    return State(path_m, speed_m_s, time_s, is_on_ramp)


def to_plane(
    path_m: PerObject, speed_m_s: PerObject, ramp_rad: Array, table_rad: Array, scene: Surroundings
) -> tuple[OfCentres, OfCentres]:
    """Positions (m) and velocities (m/s), from the path to x and y.

    Paths run parallel to ramp and table, of these slopes `[...]`, at the objects' half heights.
    """
    xp = path_m.__array_namespace__()

    def along(slope: Array) -> OfCentres:
        return xp.stack([xp.cos(slope), -xp.sin(slope)], axis=-1)[..., None, :]

    # Sines of two slopes, not of every place's.
    tangent = along(ramp_rad)
    if scene.has_table:
        tangent = xp.where(path_m[..., None] < 0, tangent, along(table_rad))
        origin = xp.stack([xp.asarray(scene.corner_m), xp.asarray(scene.half_height_m)], axis=-1)
    else:
        origin = xp.asarray(scene.start_m)
    return origin + path_m[..., None] * tangent, speed_m_s[..., None] * tangent


def pitch(position: OfCentres, scene: Surroundings) -> PerObject:
    """How far each drawn object is turned, rad: -angle on the ramp, 0 on the table, in a fall.

    While an object's length spans the foot it turns evenly per metre; what rolls is drawn as if
    it never slipped. `position`: `[..., object, 2]`; returns `[..., object]`.
    """
    xp = position.__array_namespace__()
    if any(scene.rolls):
        far = xp.sqrt(xp.sum((position - xp.asarray(scene.start_m)) ** 2, axis=-1))
        sliding = pitch(position, dataclasses.replace(scene, rolls=()))
        turned = far / xp.asarray(scene.half_height_m)
        return sliding - xp.where(xp.asarray(scene.rolls), turned, 0.0)
    if not scene.has_surface or scene.is_level:
        return xp.zeros(position.shape[:-1])
    if not scene.has_table:
        return xp.zeros(position.shape[:-1]) - scene.angle_rad
    half = xp.asarray(scene.half_length_m)
    corner = xp.asarray(scene.corner_m)
    share = xp.clip((position[..., 0] - corner + half) / (2 * half), 0.0, 1.0)
    return -scene.angle_rad * (1 - share)


def total(given: Sequence[Any | None], nothing: Any = None) -> Any:
    """The sum of what is given; `nothing` where nothing is."""
    terms = [each for each in given if each is not None]
    return sum(terms[1:], terms[0]) if terms else nothing
