"""How boxes with six coordinates each move on a table: stand, slide, turn, tip and hit one another.

A box stands on four corners with Coulomb friction, and meets others with smooth faces. Hits are met
at their time (conservative advancement along the gap), so that the motion is a continuous function
of the parameters, with JAX's derivatives; between them one step is Moreau's midpoint rule, as in
`engine_body`. Corners come down onto the table without a rebound, within a step.

Source: Moreau (1988), see `box_impulses`; Mirtich (1996), Impulse-based dynamic simulation of rigid
body systems, thesis, Berkeley, for the advancement.
"""

import functools
from itertools import combinations
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from galileo_jax.model.effects.effect import State, Surroundings
from galileo_jax.rollout.body import rotation, turned_on
from galileo_jax.rollout.box_faces import Box, Touch, touch
from galileo_jax.rollout.box_impulses import Corners, Points, Speeds, after_impulses
from galileo_jax.rollout.event_loop import step_by_events
from galileo_jax.rollout.motion import Dynamics, state_at

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


def record_later(boxes: Boxes, time_s: jax.Array, dt_s: float, shapes: Shapes) -> Boxes:
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
    touches = [touch_of(boxes, pair, shapes) for pair in pairs]
    boxes = struck(boxes, touches, pairs, time_s, shapes)
    mobility = _mobility(boxes.quaternion, shapes)
    spin = _spin(mobility, boxes)
    a = acceleration(boxes, time_s, shapes)
    soonest, lasts = left_s, []
    for found, pair in zip(touches, pairs, strict=True):
        opens = opening_rate(boxes, spin, found, pair)
        nearest = jnp.argmin(found.gaps_m)
        gap, rate = found.gaps_m[nearest], opens[nearest]
        faster = (a[pair[1]] - a[pair[0]]) @ found.normal
        meets = meets_s(gap, rate, faster)
        last = (gap < NEAR_M) & (rate > -SLOW_M_S)
        soonest = jnp.where(last, soonest, jnp.minimum(soonest, meets))
        lasts.append(last | is_last)
    spent_s = jnp.where(is_last, left_s, soonest)
    return moved(boxes, lasts, pairs, time_s, spent_s, shapes), spent_s


def meets_s(gap: jax.Array, rate: jax.Array, faster: jax.Array) -> jax.Array:
    """When a gap closes, at a rate that changes evenly; inf if it does not."""
    root2 = rate**2 - 2 * faster * gap
    meets = (rate < 0) & (root2 > 0) & (gap > TOUCH_M)
    root = jnp.sqrt(jnp.where(meets, root2, 1.0))
    at = 2 * gap / jnp.where(meets, root - rate, 1.0)
    return jnp.where(meets, at, jnp.inf)


def moved(
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
    ahead = boxes.velocity_m_s + half_s * acceleration(boxes, time_s, shapes)
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
        found = touch_of(middle, pair, shapes)
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


def struck(
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
        opens, is_near = opening_rate(boxes, spin, found, pair), found.gaps_m < TOUCH_M
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


def acceleration(boxes: Boxes, time_s: jax.Array, shapes: Shapes) -> jax.Array:
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


def touch_of(boxes: Boxes, pair: tuple[int, int], shapes: Shapes) -> Touch:
    """Where the faces of two boxes are nearest."""
    one, other = (
        Box(boxes.place_m[i], rotation(boxes.quaternion[i]), shapes.half_m[i]) for i in pair
    )
    return touch(one, other)


def _levers(boxes: Boxes, found: Touch, pair: tuple[int, int]) -> jax.Array:
    """From both centres to the points, `[2, point, 3]`."""
    return jnp.stack([found.points_m - boxes.place_m[i] for i in pair])


def opening_rate(boxes: Boxes, spin: jax.Array, found: Touch, pair: tuple[int, int]) -> jax.Array:
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
