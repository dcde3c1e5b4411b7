"""Boxes that move freely, in JAX: from the first hit on they turn, tip and leave the plane.

Until two objects meet nothing makes them leave the plane: so far the rigid engine moves them, with
all its effects. From the last record before the first hit on each box has six coordinates. It
stands on four corners with Coulomb friction, and meets others with smooth faces. Hits are met at
their time (conservative advancement along the gap, a Newton iteration), so that the motion is a
continuous function of the parameters, with JAX's derivatives; between them one step is Moreau's
midpoint rule, as in `engine_body`. Corners come down onto the table without a rebound, within a
step. MuJoCo's C engine is the check: tests/rollout/test_engine_boxes.py.

Source: Moreau (1988), see `box_impulses`; Mirtich (1996), Impulse-based dynamic simulation of rigid
body systems, thesis, Berkeley, for the advancement.
"""

import functools
from itertools import combinations
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from galileo_jax.model.effects.effect import Effect, State, Surroundings
from galileo_jax.model.model import Model
from galileo_jax.rollout.acting_laws import ActingLaws
from galileo_jax.rollout.body import rotation, turned_on
from galileo_jax.rollout.box_faces import NUM_POINTS, Box, Touch, touch
from galileo_jax.rollout.box_impulses import Corners, Points, Speeds, after_impulses
from galileo_jax.rollout.engine_jax import EngineJax
from galileo_jax.rollout.engine_rigid import roll_out as roll_out_in_plane
from galileo_jax.rollout.event_loop import step_by_events
from galileo_jax.rollout.free_start import check_free, past_the_foot_m, with_depths
from galileo_jax.rollout.motion import Dynamics, dynamics, state_at
from galileo_jax.runtime.errors import InputError

MAX_EVENTS = 8  # within one step
SUBSTEPS = 3  # of a record: 1/720 s
MOST_CORNERS = 4  # the lowest: of a box no more can stand
NEAR_M = 1e-4  # faces so near may come to touch within a step without a hit
TOUCH_M = 1e-8
SLOW_M_S = 0.02  # slower hits are plastic: nothing rattles for ever
PUSH_OUT = 0.2  # share of a step's rounding that is taken back in the next
REACH_M = 0.01  # points farther apart are of no account in a step
STILL_M_S = 1e-6
TINY = 1e-30  # keeps the derivative of a length finite at 0
SIGNS = np.array([[x, y, z] for x in (-1.0, 1.0) for y in (-1.0, 1.0) for z in (-1.0, 1.0)])
MEETING_STEPS = 3  # of Newton's method
HIT_AHEAD = 1.5  # records: so far ahead of a hit the boxes are free


class Boxes(NamedTuple):
    """All boxes at one instant; x along the table, y across it, away from the camera, z up.

    Attributes:
      place_m: `[box, 3]`, the centres.
      quaternion: `[box, 4]`, how each is turned from flat and level.
      velocity_m_s: `[box, 3]`.
      momentum_m2_s: `[box, 3]`, angular momentum over the mass, along the world's axes.
      stands_m_s2: `[box, corner, 3]`, what the table did over the last step, per mass and second.
      pushes_n: `[pair, point]`, and what the boxes did to each other.
    """

    place_m: Float[jax.Array, "box 3"]
    quaternion: Float[jax.Array, "box 4"]
    velocity_m_s: Float[jax.Array, "box 3"]
    momentum_m2_s: Float[jax.Array, "box 3"]
    stands_m_s2: Float[jax.Array, "box corner 3"]
    pushes_n: Float[jax.Array, "pair point"]


class Shapes(NamedTuple):
    """What the boxes are like, and the table.

    Attributes:
      half_m: `[box, 3]`, half the edges.
      inertia_m2: `[box, 3]`, moments of inertia over the mass.
      corner_m: `[box]`, where each centre is at the foot.
      law: of the motion.
      scene: the surroundings.
    """

    half_m: Float[jax.Array, "box 3"]
    inertia_m2: Float[jax.Array, "box 3"]
    corner_m: Float[jax.Array, " box"]
    law: Dynamics
    scene: Surroundings


def roll_out(
    effects: tuple[Effect, ...],
    names: tuple[str, ...],
    num_records: int,
    dt_s: float,
    theta: jax.Array,
    scene: Surroundings,
    count: jax.Array | None = None,
    acts: jax.Array | None = None,
) -> tuple[jax.Array, jax.Array]:
    """One rollout: `[parameter]` to centres and velocities, each `[object, 2, record]`.

    As of `engine_rigid`; NaN where the objects meet while the first still crosses the foot.
    """
    position, velocity, _ = roll_out_poses(
        effects, names, num_records, dt_s, theta, scene, count, acts
    )
    return position[:, :2], velocity[:, :2]


def roll_out_poses(
    effects: tuple[Effect, ...],
    names: tuple[str, ...],
    num_records: int,
    dt_s: float,
    theta: jax.Array,
    scene: Surroundings,
    count: jax.Array | None = None,
    acts: jax.Array | None = None,
) -> tuple[jax.Array, jax.Array, jax.Array]:
    """As `roll_out`, in space: places, velocities `[object, 3, record]`, quaternions too.

    x along the travel, y up, z towards the camera; quaternions `[object, 4, record]` in the axes
    (x, -z, y), as `engine_c_free.Poses`.
    """
    planar = roll_out_in_plane(effects, names, num_records, dt_s, theta, scene, count, acts)
    named = {name: theta[i] for i, name in enumerate(names)}
    shapes = _shapes(dynamics(effects, scene, named, jnp, acts), scene)
    num = jnp.asarray(num_records) if count is None else count
    begin = jnp.minimum(_begin(*planar, scene, dt_s), num - 1)
    before = _flat(planar[0][..., begin], planar[1][..., begin], shapes)
    first, late_s = _to_first_hit(before, begin * dt_s, shapes)

    def record(i: jax.Array, carry: tuple[Boxes, Any]) -> tuple[Boxes, Any]:
        boxes, made = carry
        boxes = _record(boxes, (i - 1) * dt_s + late_s, dt_s, shapes)
        kept = jax.tree.map(lambda all_, one: all_.at[i].set(one), made, _seen(boxes, shapes))
        return boxes, kept

    length = planar[0].shape[-1]
    made = jax.tree.map(
        lambda one: jnp.broadcast_to(one, (length, *one.shape)), _seen(first, shapes)
    )
    made = jax.lax.fori_loop(begin + 1, num, record, (first, made))[1]
    at = jnp.minimum(jnp.arange(length), num - 1) - late_s / dt_s
    is_flat = (begin >= num - 1) | (planar[0][0, 0, begin] >= past_the_foot_m(scene))
    place, speed, turned = (
        jnp.where(is_flat, jnp.where(at >= begin, after, own), jnp.nan)
        for after, own in zip(_between(made, at, dt_s), _level(*planar, scene), strict=True)
    )
    return place, speed, turned


def _to_first_hit(boxes: Boxes, time_s: jax.Array, shapes: Shapes) -> tuple[Boxes, jax.Array]:
    """The boxes as the first hit leaves them, and how long after `time_s` that is.

    Records begin anew with the hit, so that it always is at the same place in a step: the motion
    is as smooth in the parameters as bodies are, not as steps are.
    """
    pairs = list(combinations(range(len(shapes.half_m)), 2))
    late_s = jnp.zeros(())
    for _ in range(MEETING_STEPS):
        a, spin = _acceleration(boxes, time_s + late_s, shapes), jnp.zeros_like(boxes.place_m)
        times = [jnp.asarray(jnp.inf)]
        for pair in pairs:
            found = _touch(boxes, pair, shapes)
            rate = _opens(boxes, spin, found, pair)[0]
            faster = (a[pair[1]] - a[pair[0]]) @ found.normal
            times.append(_meets_s(jnp.min(found.gaps_m), rate, faster))
        soonest = jnp.min(jnp.stack(times))
        spent_s = jnp.where(jnp.isfinite(soonest), soonest, 0.0)
        lasts = [jnp.zeros((), bool) for _ in pairs]
        boxes = _moved(boxes, lasts, pairs, time_s + late_s, spent_s, shapes)
        late_s = late_s + spent_s
    touches = [_touch(boxes, pair, shapes) for pair in pairs]
    return _struck(boxes, touches, pairs, time_s + late_s, shapes), late_s


def _between(made: Any, at: jax.Array, dt_s: float) -> tuple[jax.Array, jax.Array, jax.Array]:
    """What was `made` `[record, ...]` at other times, by Hermite's cubics: `[..., record]`.

    Args:
      made: places, velocities and quaternions.
      at: `[record]`, when, in records.
      dt_s: from one to the next.
    """
    place, speed, turned = made
    last = place.shape[0] - 2
    i = jnp.clip(jnp.floor(at).astype(int), 0, last)
    s = (at - i)[:, None, None]
    x0, x1 = place[i], place[i + 1]
    v0, v1 = speed[i] * dt_s, speed[i + 1] * dt_s
    a, b = 2 * (x0 - x1) + v0 + v1, 3 * (x1 - x0) - 2 * v0 - v1
    mixed = turned[i] * (1 - s) + turned[i + 1] * s
    found = (
        ((a * s + b) * s + v0) * s + x0,
        (v0 + (v1 - v0) * s) / dt_s,
        mixed / jnp.linalg.norm(mixed, axis=-1, keepdims=True),
    )
    place, speed, turned = (jnp.moveaxis(own, 0, -1) for own in found)
    return place, speed, turned


def _level(
    position: jax.Array, velocity: jax.Array, scene: Surroundings
) -> tuple[jax.Array, jax.Array, jax.Array]:
    """Motion in the plane as motion in space."""
    beside = jnp.broadcast_to(jnp.asarray(scene.beside_m)[:, None, None], position[:, :1].shape)
    turned = jnp.array([1.0, 0.0, 0.0, 0.0])[:, None]
    return (
        jnp.concatenate([position, beside], axis=1),
        jnp.concatenate([velocity, jnp.zeros_like(beside)], axis=1),
        jnp.broadcast_to(turned, (len(position), 4, position.shape[-1])),
    )


def _shapes(law: Dynamics, scene: Surroundings) -> Shapes:
    half = jnp.stack(
        [
            jnp.asarray(own)
            for own in (scene.half_length_m, scene.half_depth_m, scene.half_height_m)
        ],
        axis=1,
    )
    square = half**2
    inertia = (jnp.sum(square, axis=1, keepdims=True) - square) / 3
    return Shapes(half, inertia, jnp.asarray(scene.corner_m), law, scene)


def _begin(position: jax.Array, velocity: jax.Array, scene: Surroundings, dt_s: float) -> jax.Array:
    """The last record before any faces meet; the number of records if none do."""
    half = jnp.asarray(scene.half_length_m)[:, None]
    x, v = position[:, 0], velocity[:, 0]
    gap = x[1:] - x[:-1] - half[1:] - half[:-1]
    closing = v[:-1] - v[1:]
    near = jnp.any((closing > 0) & (gap < HIT_AHEAD * closing * dt_s), axis=0)
    return jnp.where(jnp.any(near), jnp.argmax(near), x.shape[-1])


def _flat(position: jax.Array, velocity: jax.Array, shapes: Shapes) -> Boxes:
    """The boxes as they come over the table in the plane, from `[object, 2]`."""
    scene, cos = shapes.scene, jnp.cos(shapes.law.table_rad)
    path, speed = (position[:, 0] - shapes.corner_m) / cos, velocity[:, 0] / cos
    none = jnp.zeros_like(path)
    quaternion = jnp.zeros((len(path), 4)).at[:, 0].set(1.0)
    place = jnp.stack(
        [shapes.corner_m + path, -jnp.asarray(scene.beside_m), shapes.half_m[:, 2]], axis=1
    )
    stands = jnp.zeros((len(path), MOST_CORNERS, 3))
    return Boxes(
        place,
        quaternion,
        jnp.stack([speed, none, none], axis=1),
        jnp.zeros((len(path), 3)),
        stands.at[..., 2].set(shapes.law.gravity / MOST_CORNERS),
        jnp.zeros((len(path) * (len(path) - 1) // 2, NUM_POINTS)),
    )


def _seen(boxes: Boxes, shapes: Shapes) -> tuple[jax.Array, jax.Array, jax.Array]:
    """Places and velocities as the camera has its axes, on a table that may slope, and turnings."""
    cos, sin = jnp.cos(shapes.law.table_rad), jnp.sin(shapes.law.table_rad)
    x, across, up = boxes.place_m.T
    path = x - shapes.corner_m
    along, aside, rises = boxes.velocity_m_s.T
    place = jnp.stack([shapes.corner_m + path * cos, up - path * sin, -across], axis=1)
    speed = jnp.stack([along * cos, rises - along * sin, -aside], axis=1)
    return place, speed, boxes.quaternion


def _record(boxes: Boxes, time_s: jax.Array, dt_s: float, shapes: Shapes) -> Boxes:
    """One recorded step."""

    def advance(boxes: Boxes, time_s: jax.Array, left_s: jax.Array, is_last: jax.Array):
        return _to_next_hit(boxes, time_s, left_s, is_last, shapes)

    step_s = dt_s / SUBSTEPS

    def step(part: jax.Array, boxes: Boxes) -> Boxes:
        return step_by_events(advance, boxes, time_s + part * step_s, step_s, MAX_EVENTS)

    return jax.lax.fori_loop(0, SUBSTEPS, step, boxes)


def _to_next_hit(
    boxes: Boxes, time_s: jax.Array, left_s: jax.Array, is_last: jax.Array, shapes: Shapes
) -> tuple[Boxes, jax.Array]:
    """Moves on until a hit is due, or by `left_s`; returns the boxes and the time it took.

    When `is_last`, by `left_s` in any case: what still comes then touches without a hit.
    """
    pairs = list(combinations(range(len(shapes.half_m)), 2))
    touches = [_touch(boxes, pair, shapes) for pair in pairs]
    boxes = _struck(boxes, touches, pairs, time_s, shapes)
    mobility = _mobility(boxes.quaternion, shapes)
    spin = _spin(mobility, boxes)
    a = _acceleration(boxes, time_s, shapes)
    soonest, lasts = left_s, []
    for found, pair in zip(touches, pairs, strict=True):
        opens = _opens(boxes, spin, found, pair)
        nearest = jnp.argmin(found.gaps_m)
        gap, rate = found.gaps_m[nearest], opens[nearest]
        faster = (a[pair[1]] - a[pair[0]]) @ found.normal
        meets = _meets_s(gap, rate, faster)
        last = (gap < NEAR_M) & (rate > -SLOW_M_S)
        soonest = jnp.where(last, soonest, jnp.minimum(soonest, meets))
        lasts.append(last | is_last)
    spent_s = jnp.where(is_last, left_s, soonest)
    return _moved(boxes, lasts, pairs, time_s, spent_s, shapes), spent_s


def _meets_s(gap: jax.Array, rate: jax.Array, faster: jax.Array) -> jax.Array:
    """When a gap closes, at a rate that changes evenly; inf if it does not."""
    root2 = rate**2 - 2 * faster * gap
    meets = (rate < 0) & (root2 > 0) & (gap > TOUCH_M)
    root = jnp.sqrt(jnp.where(meets, root2, 1.0))
    at = 2 * gap / jnp.where(meets, root - rate, 1.0)
    return jnp.where(meets, at, jnp.inf)


def _moved(
    boxes: Boxes,
    lasts: list[jax.Array],
    pairs: list[tuple[int, int]],
    time_s: jax.Array,
    spent_s: jax.Array,
    shapes: Shapes,
) -> Boxes:
    """One step of Moreau's midpoint rule, with the contacts that last."""
    half_s = 0.5 * spent_s
    over = jnp.where(spent_s > 0, spent_s, 1.0)
    law = shapes.law
    place = boxes.place_m + half_s * boxes.velocity_m_s
    turned = _turned_on(boxes.quaternion, boxes.momentum_m2_s, half_s, shapes)
    mobility = _mobility(turned, shapes)
    ahead = boxes.velocity_m_s + half_s * _acceleration(boxes, time_s, shapes)
    state = _state(place, ahead, time_s + half_s, shapes)
    # Weight and drive move the inertia; MuJoCo's engines take it so, too.
    down = law.mass / law.inertia * law.gravity * jnp.cos(law.table_rad)
    pull = law.drive(state) / law.inertia
    fall = jnp.stack([pull, jnp.zeros_like(pull), -down], axis=1)
    levers, gaps = _corners(boxes.place_m, boxes.quaternion, shapes)
    lowest = _lowest(gaps)
    levers_then, _ = _corners(place, turned, shapes)
    own = jnp.take_along_axis(gaps, lowest, axis=1)
    corners = Corners(
        jnp.take_along_axis(levers_then, lowest[..., None], axis=1),
        _least(own, over),
        jnp.broadcast_to(spent_s > 0, own.shape),
        law.coefficient(state),
        spent_s * boxes.stands_m_s2,
    )
    middle = boxes._replace(place_m=place, quaternion=turned)
    points = []
    for last, pair, push in zip(lasts, pairs, boxes.pushes_n, strict=True):
        found = _touch(middle, pair, shapes)
        meets = (found.gaps_m < REACH_M) & last & (spent_s > 0)
        least = _least(found.gaps_m, over)
        levers = _levers(middle, found, pair)
        points.append(Points(levers, found.normal, least, meets, spent_s * push))
    before = Speeds(boxes.velocity_m_s + spent_s * fall, _spin(mobility, boxes))
    after, stands, pushes = after_impulses(
        before, corners, points, pairs, mobility, 1.0 / law.inertia
    )
    momentum = boxes.momentum_m2_s + _momentum(turned, after.spin - before.spin, shapes)
    return Boxes(
        boxes.place_m + half_s * (boxes.velocity_m_s + after.velocity),
        _turned_on(turned, momentum, half_s, shapes),
        after.velocity,
        momentum,
        stands / over,
        jnp.stack(pushes) / over,
    )


def _struck(
    boxes: Boxes,
    touches: list[Touch],
    pairs: list[tuple[int, int]],
    time_s: jax.Array,
    shapes: Shapes,
) -> Boxes:
    """The boxes after the hits that are due; friction at the table takes part in them."""
    law = shapes.law
    mobility = _mobility(boxes.quaternion, shapes)
    spin = _spin(mobility, boxes)
    points, any_hit = [], jnp.zeros((), bool)
    for found, pair in zip(touches, pairs, strict=True):
        opens, is_near = _opens(boxes, spin, found, pair), found.gaps_m < TOUCH_M
        is_hit = jnp.any(is_near & (opens < -SLOW_M_S))
        least = jnp.where(opens < -SLOW_M_S, -law.restitution * opens, 0.0)
        levers = _levers(boxes, found, pair)
        none = jnp.zeros_like(least)
        points.append(Points(levers, found.normal, least, is_near & is_hit, none))
        any_hit = any_hit | is_hit
    levers, gaps = _corners(boxes.place_m, boxes.quaternion, shapes)
    lowest = _lowest(gaps)
    levers = jnp.take_along_axis(levers, lowest[..., None], axis=1)
    stands = (jnp.take_along_axis(gaps, lowest, axis=1) < NEAR_M) & any_hit
    state = _state(boxes.place_m, boxes.velocity_m_s, time_s, shapes)
    none = jnp.zeros((*stands.shape, 3))
    corners = Corners(levers, jnp.zeros(stands.shape), stands, law.coefficient(state), none)
    before = Speeds(boxes.velocity_m_s, spin)
    after, _, _ = after_impulses(before, corners, points, pairs, mobility, 1.0 / law.inertia)
    momentum = boxes.momentum_m2_s + _momentum(boxes.quaternion, after.spin - spin, shapes)
    return boxes._replace(velocity_m_s=after.velocity, momentum_m2_s=momentum)


def _acceleration(boxes: Boxes, time_s: jax.Array, shapes: Shapes) -> jax.Array:
    """Of boxes that touch no other, `[box, 3]`, to look ahead with."""
    law, velocity = shapes.law, boxes.velocity_m_s[:, :2]
    speed = jnp.sqrt(jnp.sum(velocity**2, axis=1) + TINY)
    state = _state(boxes.place_m, boxes.velocity_m_s, time_s, shapes)
    drive, brake = law.drive(state) / law.inertia, law.brake(state) / law.inertia
    level = -(brake / speed)[:, None] * velocity
    level = jnp.where((speed > STILL_M_S)[:, None], level.at[:, 0].add(drive), 0.0)
    return jnp.concatenate([level, jnp.zeros_like(drive)[:, None]], axis=1)


def _state(place: jax.Array, velocity: jax.Array, time_s: jax.Array, shapes: Shapes) -> State:
    """What a law sees: effects act along the travel."""
    return state_at(place[:, 0] - shapes.corner_m, velocity[:, 0], time_s, shapes.scene)


def _touch(boxes: Boxes, pair: tuple[int, int], shapes: Shapes) -> Touch:
    one, other = (
        Box(boxes.place_m[i], rotation(boxes.quaternion[i]), shapes.half_m[i]) for i in pair
    )
    return touch(one, other)


def _levers(boxes: Boxes, found: Touch, pair: tuple[int, int]) -> jax.Array:
    """From both centres to the points, `[2, point, 3]`."""
    return jnp.stack([found.points_m - boxes.place_m[i] for i in pair])


def _opens(boxes: Boxes, spin: jax.Array, found: Touch, pair: tuple[int, int]) -> jax.Array:
    """How fast the points part, `[point]`, m/s."""
    one, other = (
        boxes.velocity_m_s[i] + jnp.cross(spin[i], found.points_m - boxes.place_m[i]) for i in pair
    )
    return (other - one) @ found.normal


def _corners(
    place: jax.Array, quaternion: jax.Array, shapes: Shapes
) -> tuple[jax.Array, jax.Array]:
    """Of all corners the levers `[box, corner, 3]` and how high they are `[box, corner]`."""
    levers = jnp.einsum("bij,bkj->bki", _turns(quaternion), SIGNS * shapes.half_m[:, None])
    return levers, place[:, None, 2] + levers[..., 2]


def _lowest(gaps: jax.Array) -> jax.Array:
    """Which corners stand, `[box, corner]`: in an order that rounding does not change."""
    return jnp.sort(jax.lax.top_k(-gaps, MOST_CORNERS)[1], axis=1)


def _least(gaps: jax.Array, over_s: jax.Array) -> jax.Array:
    return jnp.where(gaps > 0, -gaps, -PUSH_OUT * gaps) / over_s


def _turns(quaternion: jax.Array) -> jax.Array:
    return jax.vmap(rotation)(quaternion)


def _mobility(quaternion: jax.Array, shapes: Shapes) -> jax.Array:
    """From angular momenta over the masses to spins, `[box, 3, 3]`."""
    turned = _turns(quaternion)
    return jnp.einsum("bij,bj,bkj->bik", turned, 1.0 / shapes.inertia_m2, turned)


def _spin(mobility: jax.Array, boxes: Boxes) -> jax.Array:
    return jnp.einsum("bij,bj->bi", mobility, boxes.momentum_m2_s)


def _momentum(quaternion: jax.Array, spin: jax.Array, shapes: Shapes) -> jax.Array:
    """Angular momenta over the masses of boxes that spin so, `[box, 3]`."""
    turned = _turns(quaternion)
    return jnp.einsum("bij,bj,bkj,bk->bi", turned, shapes.inertia_m2, turned, spin)


def _turned_on(
    quaternion: jax.Array, momentum: jax.Array, spent_s: jax.Array, shapes: Shapes
) -> jax.Array:
    turn = functools.partial(turned_on, spent_s=spent_s)
    return jax.vmap(turn)(shapes.inertia_m2, quaternion, momentum)


class EngineBoxes(EngineJax):
    """Boxes that move freely, see the module."""

    roll_out = staticmethod(roll_out)

    def __init__(self, model: Model, laws: ActingLaws | None = None):
        """Checks the scene.

        Raises:
          InputError: an object is no box, or as of `check_free`.
        """
        check_free(model)
        for name, shape in zip(model.scene.names, model.scene.shapes, strict=True):
            if shape != "box":
                raise InputError(f"engine: rigid: {name} is a {shape}; boxes expected, or c")
        super().__init__(model, laws, with_depths(model.scene))
