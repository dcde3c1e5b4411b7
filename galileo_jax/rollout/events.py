"""The event kernel: smooth motion up to the next event, a jump there, and on, record by record.

An engine is a `System`: where it starts, and how it goes on to its next event. What finds events
and integrates between them is here, too. The last Newton step towards an event carries the
derivative of its instant, so that a motion is a continuous function of its parameters with the
right derivatives, whatever the steps.
"""

import functools
from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple, TypeVar

import jax
import jax.numpy as jnp
from jaxtyping import Float

from galileo_jax.model.effects.effect import Effect, Surroundings
from galileo_jax.rollout.motion import Dynamics, dynamics

State = TypeVar("State")  # a PyTree
Motion = tuple[
    Float[jax.Array, "*batch object axis record"], Float[jax.Array, "*batch object axis record"]
]
"""Centres (m) and velocities (m/s)."""
Advance = Callable[[Any, jax.Array, jax.Array, Any], tuple[Any, jax.Array]]
Part = Callable[[Any, jax.Array], tuple[Any, Any]]
RollOut = Callable[..., Motion]
"""See `of_task`."""

PLASTIC_M_S = 0.02  # slower impacts are plastic: nothing bounces for ever
PART = 16  # records are made in parts of so many, as many parts as are asked for
NEWTON_STEPS = 8


class Task(NamedTuple):
    """What is rolled out."""

    effects: tuple[Effect, ...]  # all that may act
    named: Mapping[str, jax.Array]  # parameters by name
    scene: Surroundings  # as declared
    dt_s: float  # from record to record
    acts: jax.Array | None  # `[effect]`, as in `motion.dynamics`
    num_records: int  # of which there are places in the result
    # Of records that are wanted; beyond, centres are as in the last of these. None: all.
    count: jax.Array | None

    def law(self) -> Dynamics:
        """The equations of motion."""
        return dynamics(self.effects, self.scene, self.named, jnp, self.acts)

    def motion(self, system: "System") -> Motion:
        """What a system does."""
        states = recorded(system, self.num_records, self.dt_s, self.count)
        return system.seen(states, self.dt_s * jnp.arange(self.num_records))


class System:
    """What an engine moves, and how; from the task alone."""

    start: Any  # the state at the release
    most_events = 16  # so many advances make up a step at most; 1: there are no events
    # Where motion between events is known in closed form, a state and the index of its record to
    # the state `PART` records later, and those at the records, `[record, ...]`
    part: Part | None = None

    def __init__(self, task: Task):
        self.law, self.scene = task.law(), task.scene

    def advance(
        self, state: Any, time_s: jax.Array, left_s: jax.Array, is_last: Any
    ) -> tuple[Any, jax.Array]:
        """The state at the next event, or after `left_s`, and the time that took.

        The latter in any case where `is_last`, so that events that never end hold up nobody.
        """
        raise NotImplementedError

    def seen(self, states: Any, times_s: jax.Array) -> Motion:
        """Centres and velocities, of states `[record, ...]` and their times."""
        raise NotImplementedError


def of_task(follows: Callable[[Task], Any]) -> Callable[..., Any]:
    """What follows from a task, as a function of the task's parts under the name of `follows`.

    It takes `(effects, names, num_records, dt_s, theta, scene, count=None, acts=None)`, theta
    `[parameter]`.
    """

    def roll_out(
        effects: tuple[Effect, ...],
        names: tuple[str, ...],
        num_records: int,
        dt_s: float,
        theta: jax.Array,
        scene: Surroundings,
        count: jax.Array | None = None,
        acts: jax.Array | None = None,
    ) -> Any:
        named = {name: theta[i] for i, name in enumerate(names)}
        return follows(Task(effects, named, scene, dt_s, acts, num_records, count))

    for name in ("__doc__", "__module__", "__name__", "__qualname__"):  # its program's name on disk
        setattr(roll_out, name, getattr(follows, name))
    return roll_out


def recorded(system: System, num_records: int, dt_s: float, count: jax.Array | None = None) -> Any:
    """The states at every record: leaves `[record, ...]`; beyond `count` bodies stay."""

    def step(state: Any, index: jax.Array) -> tuple[Any, Any]:
        after = step_by_events(system.advance, state, index * dt_s, dt_s, system.most_events)
        return after, state

    def stepped(state: Any, first: jax.Array) -> tuple[Any, Any]:
        return jax.lax.scan(step, state, first + jnp.arange(PART))

    part = system.part or stepped
    num_parts = -(-num_records // PART)
    if count is None:
        made = jax.lax.scan(part, system.start, PART * jnp.arange(num_parts))[1]
        return jax.tree.map(lambda leaf: leaf.reshape(-1, *leaf.shape[2:])[:num_records], made)

    def one(i: jax.Array, carry: tuple[Any, Any]) -> tuple[Any, Any]:
        state, made = carry
        state, own = part(state, i * PART)
        put = functools.partial(jax.lax.dynamic_update_slice_in_dim, start_index=i * PART, axis=0)
        return state, jax.tree.map(put, made, own)

    padded = num_parts * PART
    empty = jax.tree.map(lambda leaf: jnp.zeros((padded, *leaf.shape), leaf.dtype), system.start)
    made = jax.lax.fori_loop(0, -(-count // PART), one, (system.start, empty))[1]
    is_over = jnp.arange(padded) >= count

    def held(leaf: jax.Array) -> jax.Array:
        over = is_over.reshape(-1, *[1] * (leaf.ndim - 1))
        return jnp.where(over, leaf[count - 1], leaf)[:num_records]

    return jax.tree.map(held, made)


def step_by_events(
    advance: Advance, state: State, time_s: Any, dt_s: Any, most_events: int
) -> State:
    """The state a time `dt_s` later; `advance` and `most_events` as of `System`."""
    whole_s = jnp.asarray(dt_s)
    if most_events == 1:
        return advance(state, time_s, whole_s, True)[0]

    def is_left(carry: tuple[State, jax.Array, Any]) -> jax.Array:
        _, left, count = carry
        return (left > 0) & (count < most_events)

    def phase(carry: tuple[State, jax.Array, Any]):
        state, left, count = carry
        state, spent = advance(state, time_s + dt_s - left, left, count == most_events - 1)
        return state, left - spent, count + 1

    return jax.lax.while_loop(is_left, phase, (state, whole_s, 0))[0]


class Tableau(NamedTuple):
    """An explicit Runge-Kutta method, after Butcher."""

    nodes: tuple[float, ...]  # `[stage]`, of the step
    stages: tuple[tuple[float, ...], ...]  # for each stage its weights of the rates before
    weights: tuple[float, ...]  # `[stage]`, of the mean
    total: float = 1.0  # of the weights


CLASSICAL = Tableau(
    (0.0, 0.5, 0.5, 1.0), ((), (0.5,), (0.0, 0.5), (0.0, 0.0, 1.0)), (1.0, 2.0, 2.0, 1.0), 6.0
)
"""Of fourth order (Kutta, 1901)."""
DORMAND_PRINCE = Tableau(
    (0.0, 1 / 5, 3 / 10, 4 / 5, 8 / 9, 1.0),
    (
        (),
        (1 / 5,),
        (3 / 40, 9 / 40),
        (44 / 45, -56 / 15, 32 / 9),
        (19372 / 6561, -25360 / 2187, 64448 / 6561, -212 / 729),
        (9017 / 3168, -355 / 33, 46732 / 5247, 49 / 176, -5103 / 18656),
    ),
    (35 / 384, 0.0, 500 / 1113, 125 / 192, -2187 / 6784, 11 / 84),
)
"""Of fifth order (Dormand and Prince, 1980, 10.1016/0771-050X(80)90013-3)."""


def runge_kutta(
    rate: Callable[[State, Any], State],
    state: State,
    time_s: Any,
    step_s: Any,
    method: Tableau = CLASSICAL,
) -> State:
    """The state after one step of a Runge-Kutta method; `rate` of state and time."""
    rates: list[State] = []

    def moved(weights: Sequence[float], total: float = 1.0) -> State:
        used = [(weight, own) for weight, own in zip(weights, rates, strict=True) if weight]

        def leaf(value: Any, *changes: Any) -> Any:
            if not changes:
                return value
            each = zip(used, changes, strict=True)
            return value + step_s * (sum(weight * change for (weight, _), change in each) / total)

        return jax.tree.map(leaf, state, *(own for _, own in used))

    for node, weights in zip(method.nodes, method.stages, strict=True):
        rates.append(rate(moved(weights), time_s + node * step_s))
    return moved(method.weights, method.total)


def reaches_s(distance: Any, v: Any, a: Any) -> Any:
    """The first time t >= 0 at which v t + a t^2 / 2 >= `distance` on the way there; inf if never.

    Where the distance is negative: as soon as the speed is not. In the array standard.
    """
    xp = distance.__array_namespace__()
    under_root = v**2 + 2 * a * distance
    forward = (v > 0) & ((under_root > 0) | (distance <= 0))
    turning = (v <= 0) & (a > 0)
    is_real = under_root > 0
    root = xp.where(is_real, xp.sqrt(xp.where(is_real, under_root, 1.0)), 0.0)
    # For v > 0 the usual formula times its conjugate: no cancellation, and a may be zero.
    at_once = 2 * xp.maximum(distance, 0.0) / xp.where(forward, v + root, 1.0)
    later = (root - v) / xp.where(turning, a, 1.0)
    return xp.where(forward, at_once, xp.where(turning, later, xp.inf))


def cubic(x0: Any, x1: Any, v0: Any, v1: Any, share: Any) -> tuple[Any, Any]:
    """Hermite's cubic between two ends, with slopes per step, at a share of the step; its slope."""
    a, b = 2 * (x0 - x1) + v0 + v1, 3 * (x1 - x0) - 2 * v0 - v1
    return ((a * share + b) * share + v0) * share + x0, (3 * a * share + 2 * b) * share + v0


@jax.custom_jvp
def _with_slope_of(value: jax.Array, other: jax.Array) -> jax.Array:
    """The value, with the derivative of the other."""
    del other
    return value


@_with_slope_of.defjvp
def _(primals: tuple[jax.Array, jax.Array], tangents: tuple[jax.Array, jax.Array]):
    return primals[0], tangents[1]


def newton(
    level: Callable[[jax.Array], tuple[jax.Array, jax.Array]], at: jax.Array, most: Any, steps: int
) -> tuple[jax.Array, jax.Array]:
    """Where a level falls through zero, and what is left of it one step before; not below 0.

    Safeguarded by bisection, from a first guess on. Beyond `most`, the last time at which the level
    may be asked for, where it does so there only. The derivative of the instant is -d level / rate
    in any case: where bounds are a rounding apart, the last step may be one of bisection.

    `level`: a time to levels `[...]`, above zero before, and how fast they rise.
    """

    def nearer(at: jax.Array, low: jax.Array, high: jax.Array) -> tuple[jax.Array, ...]:
        at = jax.lax.stop_gradient(jnp.clip(at, 0.0, most))
        left, rate = level(at)
        rate = jax.lax.stop_gradient(rate)
        low = jnp.where(left > 0, at, low)
        high = jnp.where(left > 0, high, at)
        new = at - left / jnp.where(rate < 0, rate, -1.0)
        is_inside = (rate < 0) & (new >= low) & (new <= high)
        safe = jnp.where(is_inside, new, 0.5 * (low + high))
        return _with_slope_of(safe, jnp.where(rate < 0, new, 0.0)), low, high, left

    def early(_: Any, carry: tuple[jax.Array, ...]) -> tuple[jax.Array, ...]:
        return jax.lax.stop_gradient(nearer(*carry)[:3])

    bounds = jnp.zeros_like(at), jnp.full_like(at, jnp.inf)
    begin = jax.lax.stop_gradient((at, *bounds))
    at, _, _, left = nearer(*jax.lax.fori_loop(0, steps - 1, early, begin))
    return at, left


def to_crossing(
    state: State,
    after: Callable[[jax.Array], State],
    level: Callable[[State, jax.Array], tuple[jax.Array, jax.Array]],
    jump: Callable[[State, jax.Array], State],
    left_s: jax.Array,
    may: jax.Array,
) -> tuple[State, jax.Array]:
    """The state behind the first of some events, or after `left_s`, and the time that took.

    The instant is that of the cubic through level and rate at both ends of the step, which is off
    by the fourth power of the step.

    Args:
      state: now.
      after: the state after a time without events.
      level: of a state and the time until it, what falls through zero at an event, `[...]`, and
        how fast it rises.
      jump: the state behind the events, from that before them and which they are, `[...]`.
      left_s: what is left of the step.
      may: which events there can be, `[...]`.
    """
    whole = after(left_s)
    over = jnp.where(left_s > 0, left_s, 1.0)
    (begin, rate), (end, last_rate) = level(state, jnp.zeros_like(left_s)), level(whole, left_s)
    comes = may & (end < 0)
    # What still rises, maybe from an event, comes down late.
    guess = jnp.where(rate > 0, 1.0, begin / jnp.where(comes, begin - end, 1.0))
    on_cubic = functools.partial(cubic, begin, end, rate * over, last_rate * over)
    share, _ = newton(on_cubic, guess, 1.0, NEWTON_STEPS)
    is_there = (begin <= 0) & (rate <= 0)
    at = jnp.where(comes, jnp.where(is_there, 0.0, share * left_s), jnp.inf)
    soonest, any_comes = jnp.min(at), jnp.any(comes)
    spent_s = jnp.where(any_comes, soonest, left_s)
    jumped = jump(after(spent_s), at <= soonest)
    found = jax.tree.map(lambda one, other: jnp.where(any_comes, one, other), jumped, whole)
    return found, spent_s


class Rubbing(NamedTuple):
    """What dry friction does to motion along one coordinate; of any state it moves."""

    speed: Callable[[Any], jax.Array]
    # A state, its time and which way it slips (1, -1, 0: not) to its acceleration, and to by how
    # much the pull along the way exceeds what friction can hold, over the mass
    acceleration: Callable[[Any, Any, Any], tuple[jax.Array, jax.Array]]
    stopped: Callable[[Any], Any]  # a state without its speed
    moved: Callable[[Any, Any, jax.Array, Any], Any]  # state, its time, a time later, way


def to_turn(
    state: State, time_s: jax.Array, left_s: jax.Array, is_last: Any, rubbing: Rubbing
) -> tuple[State, jax.Array]:
    """An `advance` to where it turns back: friction holds it there, if it can."""
    speed = rubbing.speed(state)
    pulled, excess = rubbing.acceleration(state, time_s, 0.0)
    starts = jnp.where(excess > 0, jnp.sign(pulled), 0.0)
    way = jnp.where(speed == 0, starts, jnp.sign(speed))

    def level(at: State, spent_s: jax.Array) -> tuple[jax.Array, jax.Array]:
        speeds_up = rubbing.acceleration(at, time_s + spent_s, way)[0]
        return rubbing.speed(at) * way, speeds_up * way

    def turned(at: State, _: jax.Array) -> State:
        return rubbing.stopped(at)

    def after(spent_s: jax.Array) -> State:
        return rubbing.moved(state, time_s, spent_s, way)

    found, spent_s = to_crossing(state, after, level, turned, left_s, way != 0)
    found = jax.tree.map(lambda one, other: jnp.where(way == 0, one, other), state, found)
    return found, jnp.where(is_last, left_s, spent_s)
