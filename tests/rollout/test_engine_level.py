"""Discs on a level table: closed forms, conservation, slopes, and the finely stepped solver."""

import math
from dataclasses import replace

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.spatial import KDTree

from galileo_jax.model.effects.laws import LAWS
from galileo_jax.model.effects.laws.pucks import OFFSET, START
from galileo_jax.model.effects.registry import make_effects
from galileo_jax.rollout.disc_hits import Rim, facing
from galileo_jax.rollout.engine_particle import roll_out
from galileo_jax.simulation.level import draw_level, solve_level
from galileo_jax.simulation.plane import PlaneTruth

DT_S = 1 / 240
G = 9.81
EXACT = 1e-9  # m and m/s, in 64 bit
ROLL_OUT = jax.jit(roll_out, static_argnums=(0, 1, 2, 3))
LONGEST_S = 1.5
FINE_M = 2e-4  # of the solver's steps of 0.1 ms


def truth(seed: int = 0, **values: float) -> PlaneTruth:
    return draw_level(np.random.default_rng(seed), values)


def rolled_in_jax(one: PlaneTruth, seconds: float, theta: jax.Array):
    """All tests roll out as long, and share programs; what is later than `seconds` is cut off."""
    names, records = tuple(one.values), round(max(seconds, LONGEST_S) / DT_S) + 1
    found = ROLL_OUT((*one.effects, *LAWS), names, records, DT_S, theta, one.surroundings)
    return tuple(each[..., : round(seconds / DT_S) + 1] for each in found)


def rolled(one: PlaneTruth, seconds: float):
    """Places and speeds `[object, 3, record]`."""
    theta = jnp.asarray(list(one.values.values()))
    return tuple(np.asarray(each) for each in rolled_in_jax(one, seconds, theta))


def alone(**values: float) -> PlaneTruth:
    """The first puck, and another that it passes far away."""
    far = truth(start_velocity_x1=1.0, start_velocity_y1=0.0, **values)  # pyright: ignore[reportArgumentType]
    return replace(far, start_m=((0.0, 0.0), (0.0, -1.0)))


def test_a_puck_stops_where_and_when_it_should() -> None:
    one = alone(k1=0.4, start_turning1=20.0)
    radius = (one.things[0].size_m or (0.0,))[0]
    spin = radius * 20.0 / math.sqrt(2)
    size = math.hypot(1.0, spin)
    position, velocity = rolled(one, 1.0)
    stop_s = size / (0.4 * G)
    # It slides and turns evenly less, to an end at once.
    assert position[0, 0, -1] == pytest.approx(stop_s / 2, abs=EXACT)
    assert position[0, 2, -1] == pytest.approx(20.0 * stop_s / 2, abs=1e-7)
    moves = np.abs(np.asarray(velocity[0, 0])) > 0
    assert DT_S * np.flatnonzero(moves)[-1] == pytest.approx(stop_s, abs=DT_S)
    assert not np.asarray(velocity[1]).any()
    plain, _ = rolled(alone(k1=0.4, start_turning1=0.0), 1.0)
    assert plain[0, 0, -1] == pytest.approx(1.0 / (2 * 0.4 * G), abs=EXACT)


def test_equal_pucks_head_on_exchange_their_speeds() -> None:
    drawn = truth(
        m1=0.05,
        m2=0.05,
        k1=1e-5,
        k2=1e-5,
        restitution=1.0,
        start_velocity_x1=1.0,
        start_velocity_y1=0.0,
        start_turning1=0.0,
    )
    one = replace(drawn, start_m=((0.0, 0.0), (0.3, 0.0)))
    _, velocity = rolled(one, 1.0)
    assert velocity[0, :, -1] == pytest.approx([0, 0, 0], abs=1e-3)
    assert velocity[1, :, -1] == pytest.approx([1, 0, 0], abs=1e-3)


@pytest.mark.parametrize("seed", range(4))
def test_a_hit_off_centre_conserves_momenta(seed: int) -> None:
    one = truth(seed, k1=1e-5, k2=1e-5)
    masses = np.array([one.values["m1"], one.values["m2"]])
    radii = np.array([(item.size_m or (0.0,))[0] for item in one.things])
    position, velocity = (np.asarray(each) for each in rolled(one, 1.0))
    assert np.abs(velocity[1, :2, -1]).max() > 0.05  # it was hit

    def momenta(k: int) -> np.ndarray:
        linear = masses @ velocity[:, :2, k]
        (x, y), (u, v) = position[:, :2, k].T, velocity[:, :2, k].T
        orbit = x * v - y * u
        spin = radii**2 / 2 * velocity[:, 2, k]
        return np.array([*linear, masses @ (orbit + spin)])

    # The table's own friction of 1e-5 is all that takes any.
    assert momenta(-1) == pytest.approx(momenta(0), abs=1e-4 * masses.sum())
    rims = (radii[:, None] * velocity[:, 2]) ** 2 / 2
    energy = masses @ ((velocity[:, :2] ** 2).sum(axis=1) + rims)
    assert energy[-1] < energy[0]


@pytest.mark.parametrize("seed", range(6))
def test_agrees_with_the_fine_solver(seed: int) -> None:
    one = truth(seed)
    motion, hits = solve_level(one)
    position, _ = rolled(one, 1.0)
    fine = motion.at(DT_S * np.arange(position.shape[-1]))
    assert len(hits) == 1
    assert np.abs(np.asarray(position[:, :2]) - fine.position_m).max() < FINE_M
    assert np.abs(np.asarray(position[:, 2]) - fine.pitch_rad).max() < 0.05


def beside(
    ends: tuple[tuple[float, float], tuple[float, float]], wall_restitution: float, **values: float
) -> PlaneTruth:
    """The first puck alone with a wall; the other one is far away and lies still."""
    grip = values.pop("wall_grip", 0.0)
    one = alone(**values)
    walls = {"wall_restitution": wall_restitution, "wall_grip": grip}
    walls |= {f"wall_offset_{end}1": 0.0 for end in ("from", "to")}
    return replace(one, values={**one.values, **walls}, walls_m=(ends,))


@pytest.mark.parametrize("wall", [((0.2, -0.5), (0.4, 0.5)), ((0.4, 0.5), (0.2, -0.5))])
def test_an_elastic_wall_is_a_mirror(wall: tuple[tuple[float, float], tuple[float, float]]) -> None:
    """Reflected at the line one radius before the wall, the way is that without the wall."""
    one = beside(wall, 1.0, k1=0.1, start_turning1=0.0)
    radius = (one.things[0].size_m or (0.0,))[0]
    position, velocity = (np.asarray(each) for each in rolled(one, 1.5))
    free = np.asarray(rolled(alone(k1=0.1, start_turning1=0.0), 1.5)[0])
    start, along = np.array(wall[0]), np.subtract(wall[1], wall[0])
    normal = np.array([-along[1], along[0]]) / np.hypot(*along)
    normal = -normal if normal[0] > 0 else normal  # towards the puck
    beyond = np.minimum((free[0, :2].T - start) @ normal - radius, 0.0)
    expected = free[0, :2].T - 2 * beyond[:, None] * normal
    assert (beyond < 0).any()
    assert pytest.approx(expected, abs=EXACT) == position[0, :2].T
    assert np.abs(velocity[0, 1]).max() > 0.2


def test_a_wall_gives_back_and_rubs_as_it_should() -> None:
    """Head-on e is left; a turning puck gets r turning / 3 along the wall, if grip allows."""
    wall = ((0.2, -1.0), (0.2, 1.0))
    _, velocity = rolled(beside(wall, 0.6, k1=1e-5, start_turning1=9.0, wall_grip=0.9), 0.5)
    speed = np.asarray(velocity[0, :, -1])
    radius = (alone().things[0].size_m or (0.0,))[0]
    rim = radius * 9.0
    assert speed[0] == pytest.approx(-0.6, abs=1e-4)
    # The wall is to the right of what comes: a rim that turns to the left runs up it, and is held.
    assert speed[1] == pytest.approx(-rim / 3, abs=1e-4)
    assert radius * speed[2] == pytest.approx(rim / 3, abs=1e-4)
    _, velocity = rolled(beside(wall, 0.6, k1=1e-5, start_turning1=9.0, wall_grip=0.01), 0.5)
    assert np.asarray(velocity[0, 1, -1]) == pytest.approx(-0.016, abs=1e-4)  # 0.01 (1 + e) v


def test_what_passes_beside_a_wall_or_is_slow_does_not_bounce() -> None:
    ended = rolled(beside(((0.2, 0.01), (0.2, 0.5)), 1.0, k1=0.1), 1.0)[0]
    free = rolled(alone(k1=0.1), 1.0)[0]
    assert np.asarray(ended) == pytest.approx(np.asarray(free), abs=1e-12)
    one = beside(((0.2, -1.0), (0.2, 1.0)), 0.9, k1=0.1, start_turning1=0.0)
    tilted = replace(
        one,
        values={**one.values, "table_tilt": 0.15, "table_tilt_y": 0.0},
        effects=make_effects(["table_tilt"]),
    )
    place, speed = rolled(tilted, 4.0)  # slides down against the wall, and stays there
    radius = (one.things[0].size_m or (0.0,))[0]
    assert np.asarray(place[0, 0]).max() < 0.2 - radius + 1e-4
    assert np.asarray(place[0, 0, -1]) == pytest.approx(0.2 - radius, abs=1e-4)
    assert np.abs(np.asarray(speed[0, :2, -1])).max() < 0.02


def uneven(one: PlaneTruth, *shares: float) -> PlaneTruth:
    """With the pressure's centres of both pucks beside the middle, x and y of each."""
    names = [f"uneven_pressure_{axis}{i}" for i in (1, 2) for axis in "xy"]
    values = {**one.values, **dict(zip(names, shares, strict=True))}
    effects = make_effects(["uneven_pressure"])
    return replace(one, values=values, effects=effects)


def test_pressure_beside_the_middle_turns_a_puck() -> None:
    """At first by 2 k g c / r^2, by nothing where it trails; energy goes by k m g |W|."""
    still = alone(k1=0.3, start_turning1=0.0)
    radius = (still.things[0].size_m or (0.0,))[0]
    _, velocity = rolled(uneven(still, 0.0, -0.2, 0.0, 0.0), 0.5)
    rate = np.asarray(velocity[0, 2, 1]) / DT_S
    assert rate == pytest.approx(2 * 0.3 * G * -0.2 / radius, rel=0.05)
    place, _ = rolled(uneven(still, -0.2, 0.0, 0.0, 0.0), 0.5)
    assert np.asarray(place[0, 2]) == pytest.approx(np.zeros(121), abs=EXACT)
    one = uneven(alone(k1=0.3, start_turning1=9.0), 0.15, -0.2, 0.0, 0.0)
    place, velocity = (np.asarray(each)[0] for each in rolled(one, 0.3))
    rim = radius / math.sqrt(2)
    energy = 0.5 * (velocity[0] ** 2 + velocity[1] ** 2 + (rim * velocity[2]) ** 2)
    x, y = (
        0.15 * np.cos(place[2]) + 0.2 * np.sin(place[2]),
        (0.15 * np.sin(place[2]) - 0.2 * np.cos(place[2])),
    )
    slip = velocity[:2] + radius * velocity[2] * np.stack([-y, x])
    size = np.sqrt((slip**2).sum(axis=0) + (rim * velocity[2]) ** 2)
    lost = 0.3 * G * DT_S * (size[1:] + size[:-1]) / 2
    assert -np.diff(energy)[:60] == pytest.approx(lost[:60], rel=2e-3)


@pytest.mark.parametrize("seed", [0, 2])
def test_uneven_pressure_agrees_with_the_fine_solver(seed: int) -> None:
    drawn = draw_level(np.random.default_rng(seed), {}, has_walls=True)
    one = uneven(drawn, 0.2, -0.1, 0.05, 0.2)
    motion, _ = solve_level(one)
    position, _ = rolled(one, 1.2)
    fine = motion.at(DT_S * np.arange(position.shape[-1]))
    assert np.median(np.abs(np.asarray(position[:, :2]) - fine.position_m)) < 1e-5
    assert np.abs(np.asarray(position[:, 2]) - fine.pitch_rad).max() < 5e-3


def oval(one: PlaneTruth, *shares: float) -> PlaneTruth:
    """With rims that are not round, c and s of each."""
    names = [f"oval_rim_{part}{i}" for i in (1, 2) for part in "cs"]
    values = {**one.values, **dict(zip(names, shares, strict=True))}
    effects = make_effects(["oval_rim"])
    return replace(one, values=values, effects=effects)


def outline(radius: float, c: float, s: float) -> np.ndarray:
    """Points of a rim about its middle, `[point, 2]`."""
    angles = np.linspace(0, 2 * np.pi, 20001)
    h = radius * (1 + c * np.cos(2 * angles) + s * np.sin(2 * angles))
    slope = 2 * radius * (s * np.cos(2 * angles) - c * np.sin(2 * angles))
    along = np.stack([np.cos(angles), np.sin(angles)], axis=1)
    return h[:, None] * along + slope[:, None] * along[:, ::-1] * [-1.0, 1.0]


@pytest.mark.parametrize(
    "shares", [(0.05, 0.0, 0.0, 0.0), (0.03, -0.06, 0.0, 0.1), (-0.1, 0.05, 0.08, 0.02)]
)
def test_oval_rims_face_each_other_where_their_outlines_are_nearest(
    shares: tuple[float, float, float, float],
) -> None:
    radii, apart = np.array([0.02, 0.03]), np.array([0.045, 0.03])
    rims = [
        Rim(jnp.asarray(radius), jnp.asarray(pair), jnp.asarray(0.0))
        for radius, pair in zip(radii, (shares[:2], shares[2:]), strict=True)
    ]
    direction, gap = facing(jnp.asarray(apart), rims[0], rims[1])
    one, other = outline(radii[0], *shares[:2]), apart + outline(radii[1], *shares[2:])
    distances, indices = (np.asarray(each) for each in KDTree(other).query(one))
    nearest = int(np.argmin(distances))
    assert gap == pytest.approx(distances[nearest], abs=1e-6)
    way = other[indices[nearest]] - one[nearest]
    assert float(direction) == pytest.approx(math.atan2(way[1], way[0]), abs=2e-3)


def test_an_oval_rim_turns_what_it_hits_without_grip() -> None:
    """Head-on: momentum is conserved, and each turns by r^2 m w / 2 = h' P about its middle."""
    drawn = truth(
        k1=1e-5,
        k2=1e-5,
        grip=0.0,
        restitution=0.8,
        start_velocity_x1=1.0,
        start_velocity_y1=0.0,
        start_turning1=0.0,
    )
    one = replace(drawn, start_m=((0.0, 0.0), (0.3, 0.0)))
    position, velocity = (np.asarray(each) for each in rolled(oval(one, 0.0, 0.04, 0.0, 0.0), 1.0))
    masses = np.array([one.values["m1"], one.values["m2"]])
    radii = np.array([(item.size_m or (0.0,))[0] for item in one.things])
    given = masses[1] * velocity[1, :2, -1]
    assert np.hypot(*given) > 0.0
    assert masses @ velocity[:, 0, -1] == pytest.approx(masses[0], rel=1e-3)
    # About object 1's middle: the impulse is at h along the normal and h' across it.
    push, angle = np.hypot(*given), math.atan2(given[1], given[0])
    slope = 2 * radii[0] * 0.04 * math.cos(2 * angle)
    spin = masses[0] * radii[0] ** 2 / 2 * velocity[0, 2, -1]
    assert spin == pytest.approx(slope * push, rel=1e-3)
    assert abs(angle) > 0.02
    assert velocity[1, 2, -1] == pytest.approx(0.0, abs=1e-9)
    hit = np.flatnonzero(velocity[1, 0] > 0)[0]
    assert position[1, 0, hit - 1] == pytest.approx(0.3)


@pytest.mark.parametrize(("seed", "has_walls"), [(0, False), (3, False), (2, True)])
def test_oval_rims_agree_with_the_fine_solver(seed: int, has_walls: bool) -> None:
    drawn = draw_level(np.random.default_rng(seed), {}, has_walls=has_walls)
    one = oval(drawn, 0.04, -0.03, -0.05, 0.02)
    motion, _ = solve_level(one)
    position, _ = (np.asarray(each) for each in rolled(one, 1.2))
    fine = motion.at(DT_S * np.arange(position.shape[-1]))
    apart = np.abs(position[:, :2] - fine.position_m)
    assert apart.max() < 2 * FINE_M
    assert np.median(apart) < 1e-5
    assert np.abs(position[:, 2] - fine.pitch_rad).max() < 0.05
    free, _ = rolled(drawn, 1.2)
    assert np.abs(position - np.asarray(free)).max() > 10 * FINE_M


def test_rims_that_are_hardly_oval_move_as_round_ones() -> None:
    drawn = draw_level(np.random.default_rng(2), {}, has_walls=True)
    position, _ = rolled(oval(drawn, 0.0, 0.0, 0.0, 0.0), 1.2)
    expected, _ = rolled(drawn, 1.2)
    assert np.asarray(position) == pytest.approx(np.asarray(expected), abs=1e-8)


@pytest.mark.parametrize("seed", [0, 2, 4])
def test_walls_agree_with_the_fine_solver(seed: int) -> None:
    one = draw_level(np.random.default_rng(seed), {}, has_walls=True)
    motion, _ = solve_level(one)
    position, _ = rolled(one, 1.2)
    fine = motion.at(DT_S * np.arange(position.shape[-1]))
    apart = np.abs(np.asarray(position[:, :2]) - fine.position_m)
    assert apart.max() < FINE_M  # in the frame of a hit; beside it
    assert np.median(apart) < 1e-6
    assert np.abs(np.asarray(position[:, 2]) - fine.pitch_rad).max() < 0.05
    free, _ = rolled(truth(seed), 1.2)
    assert np.abs(np.asarray(position - free)).max() > 10 * FINE_M
    (x, y), (u, v) = np.min(one.walls_m, axis=(0, 1)), np.max(one.walls_m, axis=(0, 1))
    for at, item in zip(np.asarray(position[:, :2]), one.things, strict=True):
        radius = (item.size_m or (0.0,))[0]
        low, high = at.min(axis=1) - radius, at.max(axis=1) + radius
        assert low[0] > x - 1e-6 and low[1] > y - 1e-6
        assert high[0] < u + 1e-6 and high[1] < v + 1e-6


@pytest.mark.parametrize("name", ["table_tilt", "air_drag", "viscous_drag", "stribeck"])
def test_effects_agree_with_the_fine_solver(name: str) -> None:
    one = truth(3)
    effects = make_effects([name])
    scene = one.surroundings
    given = {"table_tilt": 0.02, "table_tilt_y": -0.01, "stribeck": 0.5, "stribeck_speed": 0.3}
    values = {p.name: given.get(p.name, 0.05) for e in effects for p in e.parameters(scene)}
    changed = replace(one, values={**one.values, **values}, effects=effects)
    motion, _ = solve_level(changed)
    position, _ = rolled(changed, 1.0)
    fine = motion.at(DT_S * np.arange(position.shape[-1]))
    assert np.abs(np.asarray(position[:, :2]) - fine.position_m).max() < 2 * FINE_M
    plain, _ = rolled(one, 1.0)
    assert np.abs(np.asarray(position - plain)).max() > 10 * FINE_M


@pytest.mark.parametrize(
    ("seed", "has_walls", "is_oval"),
    [
        (0, False, False),
        (5, False, False),
        pytest.param(2, True, False, marks=pytest.mark.slow),  # the next has all that this has
        (2, True, True),
    ],
)
def test_slopes_agree_with_differences(seed: int, has_walls: bool, is_oval: bool) -> None:
    one = draw_level(np.random.default_rng(seed), {}, has_walls)
    one = oval(one, 0.04, -0.03, -0.05, 0.02) if is_oval else one
    names = tuple(one.values)
    theta = np.array([one.values[name] for name in names])

    def at_end(values: jax.Array) -> jax.Array:
        return rolled_in_jax(one, 1.0, values)[0][..., ::12]

    slopes = np.asarray(jax.jacfwd(at_end)(jnp.asarray(theta)))
    steps = np.array(1e-6 * np.maximum(np.abs(theta), 0.01))
    for k, name in enumerate(names):
        step = steps[k] * np.eye(len(theta))[k]
        difference = np.asarray(
            at_end(jnp.asarray(theta + step)) - at_end(jnp.asarray(theta - step))
        )
        difference = difference / (2 * steps[k])
        scale = np.abs(difference).max() + 1e-6
        assert np.abs(slopes[..., k] - difference).max() < 1e-3 * scale, name
    assert START[0] + "1" in names and f"{OFFSET}_x2" in names
