"""Where boxes touch: by hand where faces lie on each other, by MuJoCo's distances elsewhere."""

# mujoco's classes live in a compiled module without stubs.
# pyright: reportAttributeAccessIssue=false

import jax
import jax.numpy as jnp
import mujoco
import numpy as np
import pytest

from galileo_jax.rollout.box_faces import AFAR_M, Box, touch

HALF_M = (np.array([0.03, 0.025, 0.02]), np.array([0.02, 0.04, 0.05]))
DISTANCE_ATOL_M = 1e-6  # of MuJoCo's iteration

SCENE = """<mujoco><worldbody>
<body><freejoint/><geom type="box" size="{} {} {}"/></body>
<body><freejoint/><geom type="box" size="{} {} {}"/></body>
</worldbody></mujoco>"""


def turned(yaw_rad: float) -> np.ndarray:
    cos, sin = np.cos(yaw_rad), np.sin(yaw_rad)
    return np.array([[cos, -sin, 0.0], [sin, cos, 0.0], [0.0, 0.0, 1.0]])


def boxes(apart_m: float, aside_m: float, yaws_rad=(0.0, 0.0)) -> tuple[Box, Box]:
    """Side by side on a table: the second further along x, and across."""
    (a, b) = HALF_M
    centres = np.array([[0.0, 0.0, a[2]], [a[0] + b[0] + apart_m, aside_m, b[2]]])
    return (
        Box(*map(jnp.asarray, (centres[0], turned(yaws_rad[0]), a))),
        Box(*map(jnp.asarray, (centres[1], turned(yaws_rad[1]), b))),
    )


def mujoco_distance_m(one: Box, other: Box) -> float:
    model = mujoco.MjModel.from_xml_string(SCENE.format(*one.half_m, *other.half_m))
    data = mujoco.MjData(model)
    for i, box in enumerate((one, other)):
        quaternion = np.zeros(4)
        mujoco.mju_mat2Quat(quaternion, np.ravel(box.turned))
        data.qpos[7 * i : 7 * i + 7] = [*box.centre_m, *quaternion]
    mujoco.mj_forward(model, data)
    return mujoco.mj_geomDistance(model, data, 0, 1, 1.0, None)


@pytest.mark.parametrize("aside_m", [0.0, 0.02, -0.05])
def test_faces_that_lie_on_each_other(aside_m):
    """The corners of the rectangle that they share; the second box is wider and higher."""
    one, other = boxes(1e-4, aside_m)
    found = touch(one, other)
    is_there = found.gaps_m < AFAR_M
    assert found.normal == pytest.approx([1.0, 0.0, 0.0])
    assert found.gaps_m[is_there] == pytest.approx(1e-4)
    (a, b), seen = HALF_M, found.points_m[is_there]
    low, high = max(-a[1], aside_m - b[1]), min(a[1], aside_m + b[1])
    shared = {(y, z) for y in (low, high) for z in (0.0, 2 * a[2])}
    assert {(round(float(y), 9), round(float(z), 9)) for _, y, z in seen} == {
        (round(y, 9), round(z, 9)) for y, z in shared
    }


def test_the_other_way_round():
    one, other = boxes(2e-3, 0.01, (0.2, -0.1))
    there, back = touch(one, other), touch(other, one)
    assert there.normal == pytest.approx(-back.normal)
    assert there.gaps_m.min() == pytest.approx(back.gaps_m.min())


@pytest.mark.parametrize("seed", range(12))
def test_distance(seed):
    """An edge before a face."""
    rng = np.random.default_rng(seed)
    one, other = boxes(0.012, rng.uniform(-0.005, 0.005), rng.uniform(-0.3, 0.3, 2))
    found = touch(one, other)
    expected = mujoco_distance_m(one, other)
    assert expected > 0
    assert float(found.gaps_m.min()) == pytest.approx(expected, abs=DISTANCE_ATOL_M)


@pytest.mark.parametrize("seed", range(6))
def test_gaps_grow_as_the_boxes_part(seed):
    """The nearest gap's derivative along x is the normal's x."""
    rng = np.random.default_rng(100 + seed)
    one, other = boxes(0.012, rng.uniform(-0.005, 0.005), rng.uniform(-0.3, 0.3, 2))

    def gap(x):
        return touch(
            one, other._replace(centre_m=other.centre_m + np.array([1.0, 0, 0]) * x)
        ).gaps_m.min()

    assert float(jax.grad(gap)(0.0)) == pytest.approx(float(touch(one, other).normal[0]), abs=1e-9)


def test_boxes_beside_each_other_share_no_face():
    one, other = boxes(-0.01, 0.2)
    assert touch(one, other).gaps_m.min() > 0.1
