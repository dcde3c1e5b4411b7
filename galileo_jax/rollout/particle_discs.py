"""Discs that slide and turn on a level table, seen from above.

Each disc is a point (x, y, s) with s = r turning / sqrt(2), whose friction has one size and points
against its velocity (`effects/laws/pucks.py`). Between events a midpoint step of 1/240 s is exact
for constant friction on a level table, and second order for every other law; a stop or a hit is
met at its time (`disc_hits`).

Discs that touch and press, or are pressed against a wall, are held apart by small plastic impacts.
Walls have no thickness: a disc is on that side on which its centre is.
"""

from itertools import combinations

import jax
import jax.numpy as jnp
import numpy as np

from galileo_jax.rollout.disc_hits import (
    ROOT2,
    Discs,
    Table,
    after_bounces,
    after_hit,
    bounce_times_s,
    hit_times_s,
    length,
)
from galileo_jax.rollout.events import System, Task
from galileo_jax.rollout.motion import Dynamics, state_at, total
from galileo_jax.rollout.particle_free import magnified, start_velocity


class DiscSystem(System):
    """Discs on a level table; the track's third axis, where it has one, is the turning, rad."""

    def __init__(self, task: Task):
        super().__init__(task)
        self.shown = magnified(task.effects, task.named, task.scene, axis=0)
        self.table = _table(task, self.law, self.shown)
        velocity = start_velocity(task.effects, task.named, task.scene)
        assert velocity is not None  # the pucks' law gives one
        first = jnp.asarray(task.scene.start_m)
        # Starts and turning as the camera's scale will show them.
        start = first[0, :2] + (first[:, :2] - first[0, :2]) / self.shown
        turning = (self.table.radius_m * velocity[:, 2] / ROOT2)[:, None]
        self.start = Discs(
            jnp.pad(start + self.table.rims.offset_m, ((0, 0), (0, 1))),
            jnp.concatenate([velocity[:, :2], turning], axis=1),
            jnp.zeros(len(start)),
        )

    def seen(self, states, times_s):
        """As the camera shows them."""
        place, speed = (jnp.moveaxis(each, 0, -1) for each in (states.place_m, states.speed_m_s))
        if self.scene.num_axes == 2:
            return place[:, :2], speed[:, :2]
        first = jnp.asarray(self.scene.start_m)
        per_turn = ROOT2 / self.table.radius_m[:, None, None] / self.shown
        turned = first[0, 2] + (first[:, 2:, None] - first[0, 2]) / self.shown
        return (
            jnp.concatenate([place[:, :2], turned + per_turn * place[:, 2:]], axis=1),
            jnp.concatenate([speed[:, :2], per_turn * speed[:, 2:]], axis=1),
        )

    def advance(self, state, time_s, left_s, is_last):
        """To the next stop, hit or bounce."""
        discs, table = state, self.table
        pairs = np.array(list(combinations(range(len(self.scene.names)), 2)), int).reshape(-1, 2)
        a = self._acceleration(discs, time_s)
        half = 0.5 * jnp.minimum(left_s, jnp.min(_stops(discs, a)))
        a = self._acceleration(discs.after(a, half), time_s + half)
        # What rests stays, whatever the half step before it rounds to.
        rests = (length(discs.speed_m_s) == 0) & (length(a) == 0)
        a = jnp.where(rests[:, None], 0.0, a)
        stops, hits = _stops(discs, a), hit_times_s(discs, a, pairs, left_s, table)
        bounces = bounce_times_s(discs, a, left_s, table)
        soonest = jnp.minimum(left_s, jnp.min(jnp.concatenate([stops, hits, bounces.ravel()])))
        t = jnp.where(is_last, left_s, soonest)
        moved = discs.after(a, t)
        speed = jnp.where((stops <= t)[:, None], 0.0, moved.speed_m_s)
        for k, pair in enumerate(pairs):
            speed = jnp.where(hits[k] <= t, after_hit(moved, speed, pair, table), speed)
        place, speed = after_bounces(moved._replace(speed_m_s=speed), bounces <= t, table)
        return moved._replace(place_m=place, speed_m_s=speed), t

    def _acceleration(self, discs: Discs, time_s: jax.Array) -> jax.Array:
        """Of every disc, `[object, 3]`."""
        law, scene, speed = self.law, self.scene, discs.speed_m_s
        along = length(speed[:, :2])
        forward = speed[:, :2] / jnp.where(along > 0, along, 1.0)[:, None]
        lever = _lever(discs, self.table)
        slip = speed.at[:, :2].add(speed[:, 2:] * lever)
        size = length(slip)
        drive = law.drive(state_at(discs.way_m, along, time_s, scene)) / law.inertia
        brake = law.brake(state_at(discs.way_m, size, time_s, scene)) / law.inertia
        downhill = law.gravity * jnp.stack([jnp.sin(law.ramp_rad), jnp.sin(law.table_rad)])
        pull = jnp.concatenate(
            [drive[:, None] * forward + downhill, jnp.zeros((len(scene.names), 1))], axis=1
        )
        strength = length(pull)
        against = jnp.where(
            (size > 0)[:, None],
            slip / jnp.where(size > 0, size, 1.0)[:, None],
            pull / jnp.where(strength > 0, strength, 1.0)[:, None],
        )
        against = against.at[:, 2].add(jnp.sum(lever * against[:, :2], axis=1))
        held = (size == 0) & (strength <= brake)
        return jnp.where(held[:, None], 0.0, pull - brake[:, None] * against)


def _table(task: Task, law: Dynamics, shown: jax.Array) -> Table:
    """What does not change in a rollout; `shown`: how many times as large lengths look."""
    effects, named, scene, *_ = task
    rims = next(found for e in effects if (found := e.rims(named, scene)) is not None)
    walls = next((each for e in effects if (each := e.walls(named, scene)) is not None), None)
    if walls is not None:
        origin = jnp.asarray(scene.start_m)[0, :2]
        walls = walls._replace(ends_m=origin + (walls.ends_m - origin) / shown)
    return Table(
        law,
        rims,
        jnp.asarray(scene.half_length_m),
        walls,
        total([e.pressure(named, scene) for e in effects]),
        total([e.oval(named, scene) for e in effects]),
    )


def _lever(discs: Discs, table: Table) -> jax.Array:
    """How fast the centre of the pressure moves beside the middle per r turning / sqrt(2)."""
    if table.pressure is None:
        return jnp.zeros((len(table.radius_m), 2))
    turned = ROOT2 * discs.place_m[:, 2] / table.radius_m
    cos, sin = jnp.cos(turned), jnp.sin(turned)
    x, y = table.pressure.T
    return ROOT2 * jnp.stack([-(sin * x + cos * y), cos * x - sin * y], axis=1)


def _stops(discs: Discs, a: jax.Array) -> jax.Array:
    """When each disc comes to rest at constant acceleration, s; inf where it does not."""
    size = length(discs.speed_m_s)
    moves = size > 0
    slows = -jnp.sum(discs.speed_m_s * a, axis=1) / jnp.where(moves, size, 1.0)
    ends = moves & (slows > 0)
    return jnp.where(ends, size / jnp.where(ends, slows, 1.0), jnp.inf)
