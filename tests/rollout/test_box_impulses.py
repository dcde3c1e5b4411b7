"""Impulses between boxes, by the closed form of a plastic hit and by what they must obey."""

import jax.numpy as jnp
import numpy as np
import pytest

from galileo_jax.rollout.box_impulses import Corners, Points, Speeds, after_impulses

MASS_KG, SIDE_M, SPEED_M_S = np.array([0.5, 0.3]), 0.06, 1.2
SOLVED_M_S = 1e-8


def cubes_meet(aside_m: float, restitution: float) -> Speeds:
    """Two cubes in the air, the second aside; the first comes along x."""
    half = SIDE_M / 2
    share = [(y, z) for y in (aside_m - half, half) for z in (-half, half)]
    levers = jnp.array(
        [[(half, y, z) for y, z in share], [(-half, y - aside_m, z) for y, z in share]]
    )
    least = jnp.full(4, restitution * SPEED_M_S)
    touches, none = jnp.ones(4, bool), jnp.zeros(4)
    points = Points(levers, jnp.array([1.0, 0.0, 0.0]), least, touches, none)
    table = Corners(
        jnp.zeros((2, 1, 3)),
        jnp.zeros((2, 1)),
        jnp.zeros((2, 1), bool),
        jnp.zeros(2),
        jnp.zeros((2, 1, 3)),
    )
    before = Speeds(jnp.zeros((2, 3)).at[0, 0].set(SPEED_M_S), jnp.zeros((2, 3)))
    mobility = jnp.broadcast_to(jnp.eye(3) * 6 / SIDE_M**2, (2, 3, 3))
    return after_impulses(before, table, [points], [(0, 1)], mobility, jnp.array(1 / MASS_KG))[0]


@pytest.mark.parametrize("aside_m", [0.01, -0.02, 0.03])
def test_a_plastic_hit_off_centre(aside_m):
    """One impulse at y = z I1 / (I1 + I2): J (1/m1 + 1/m2 + y^2/I1 + (z - y)^2/I2) = v."""
    inertia = MASS_KG * SIDE_M**2 / 6
    at = aside_m * inertia[0] / inertia.sum()
    arms = np.array([at, at - aside_m])
    impulse = SPEED_M_S / np.sum(1 / MASS_KG + arms**2 / inertia)
    after = cubes_meet(aside_m, 0.0)
    assert np.asarray(after.velocity[:, 0]) == pytest.approx(
        [SPEED_M_S - impulse / MASS_KG[0], impulse / MASS_KG[1]], abs=SOLVED_M_S
    )
    assert np.asarray(after.spin[:, 2]) == pytest.approx(
        [impulse * at / inertia[0], -impulse * arms[1] / inertia[1]], abs=SOLVED_M_S / SIDE_M
    )


@pytest.mark.parametrize("restitution", [0.3, 1.0])
def test_squarely_with_restitution(restitution):
    velocity = np.asarray(cubes_meet(0.0, restitution).velocity[:, 0])
    assert velocity[1] - velocity[0] == pytest.approx(restitution * SPEED_M_S, abs=SOLVED_M_S)
    assert MASS_KG @ velocity == pytest.approx(MASS_KG[0] * SPEED_M_S, abs=SOLVED_M_S)


@pytest.mark.parametrize("friction", [0.1, 0.5])
def test_a_box_on_the_table_is_braked_and_held(friction):
    """Coulomb: a step takes mu g dt of the speed, or all of it; the table carries the weight."""
    dt, half = 1e-3, SIDE_M / 2
    levers = jnp.array([[(x, y, -half) for x in (-half, half) for y in (-half, half)]])
    for speed, expected in ((1.0, 1.0 - friction * 9.81 * dt), (0.5 * friction * 9.81 * dt, 0.0)):
        corners = Corners(
            levers,
            jnp.zeros((1, 4)),
            jnp.ones((1, 4), bool),
            jnp.array([friction]),
            jnp.zeros((1, 4, 3)),
        )
        before = Speeds(jnp.array([[speed, 0.0, -9.81 * dt]]), jnp.zeros((1, 3)))
        mobility = jnp.eye(3)[None] * 6 / SIDE_M**2
        after, stands, _ = after_impulses(before, corners, [], [], mobility, jnp.ones(1))
        assert np.asarray(after.velocity[0]) == pytest.approx([expected, 0.0, 0.0], abs=SOLVED_M_S)
        assert np.asarray(after.spin) == pytest.approx(0.0, abs=SOLVED_M_S / SIDE_M)
        assert float(stands[0, :, 2].sum()) == pytest.approx(9.81 * dt, abs=SOLVED_M_S)
