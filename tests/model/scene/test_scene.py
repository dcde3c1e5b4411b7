"""The scene is the clip's geometry, and MuJoCo agrees that it stands."""

import math

import mujoco
import numpy as np
import pytest

from galileo_jax.assembly.build_scene import build_scene
from galileo_jax.clip.schema import Clip, ClipObject
from galileo_jax.clip.sizes import extents
from galileo_jax.files.package_data import scene_path
from galileo_jax.model.model import Model
from galileo_jax.observation.observation import Observation
from galileo_jax.rollout.engine_c import EngineC
from galileo_jax.rollout.motion import to_plane
from galileo_jax.runtime.errors import InputError
from tests.ramp_model import HIT
from tests.reference_ramp import solve

PLACE_ATOL_M = 1e-9

SHAPES = {
    "box": (0.06, 0.05, 0.04),
    "cylinder": (0.03, 0.04),
    "torus": (0.025, 0.008),
    "sphere": (0.03,),
}
HALVES = {"box": (0.03, 0.02), "cylinder": (0.03, 0.02), "torus": (0.033, 0.008)} | {
    "sphere": (0.03, 0.03)
}


def observed(centres, times=None):
    count, _, frames = np.shape(centres)
    names = tuple(f"object{i + 1}" for i in range(count))
    times = np.arange(frames) / 30 if times is None else times
    covariance = np.broadcast_to(1e-8 * np.eye(2)[None, ..., None], (count, 2, 2, frames))
    return Observation(
        names, times, np.asarray(centres, float), covariance, np.ones((count, frames), bool)
    )


def clip(tmp_path, scenario="ramp", angle=20.0, shapes=("box", "box"), sizes=None):
    sizes = sizes or [SHAPES[shape] for shape in shapes]
    return Clip(
        path=tmp_path / "clip.yaml",
        video=None,
        track=tmp_path / "clip.csv",
        scenario=scenario,
        fps=30.0,
        frame_count=3,
        ramp_angle_deg=angle,
        objects=tuple(
            ClipObject(name=f"object{i + 1}", shape=shape, size_m=size)
            for i, (shape, size) in enumerate(zip(shapes, sizes, strict=True))
        ),
    )


def test_the_file_itself_is_a_scene():
    model = mujoco.MjModel.from_xml_path(str(scene_path("ramp.xml")))  # pyright: ignore
    data = mujoco.MjData(model)  # pyright: ignore
    for _ in range(200):
        mujoco.mj_step(model, data)  # pyright: ignore
    assert data.qpos[0] > 0.01, "object 1 slides"


@pytest.mark.parametrize("shape", SHAPES)
def test_extents(shape):
    declared = ClipObject(name="object1", shape=shape, size_m=SHAPES[shape])
    assert extents(declared) == pytest.approx(HALVES[shape])
    unknown = extents(ClipObject(name="object1", shape=shape))
    assert all(0.004 < half < 0.1 for half in unknown)


@pytest.mark.parametrize("shape", SHAPES)
@pytest.mark.parametrize("angle", [10.0, 20.0, 40.0])
def test_objects_stand_where_they_are_seen(shape, angle, tmp_path):
    half = HALVES[shape][1]
    sin, cos = math.sin(math.radians(angle)), math.cos(math.radians(angle))
    # Seen 3 mm above the ramp, across it: only the place along it is taken.
    first = np.array([-0.4 * cos + (half + 0.003) * sin, 0.4 * sin + (half + 0.003) * cos])
    centres = np.stack([first, [0.25, 0.05]])[..., None].repeat(3, axis=-1)
    scene = build_scene(clip(tmp_path, angle=angle, shapes=(shape, "box")), observed(centres))
    start = np.asarray(scene.surroundings.start_m)
    assert start[0] == pytest.approx(
        [-0.4 * cos + half * sin, 0.4 * sin + half * cos], abs=PLACE_ATOL_M
    )
    assert start[1] == pytest.approx([0.25, HALVES["box"][1]], abs=PLACE_ATOL_M)
    assert scene.names == ("object1", "object2")
    data = mujoco.MjData(scene.model)  # pyright: ignore
    mujoco.mj_forward(scene.model, data)  # pyright: ignore
    assert data.xpos[1:, [0, 2]] == pytest.approx(start, abs=PLACE_ATOL_M)
    # Sleds touch and do not press; nothing else touches.
    assert all(abs(contact.dist) < 1e-6 for contact in data.contact)


@pytest.mark.parametrize("angle", [10.0, 40.0])
def test_paths_are_the_places_along_ramp_and_table(angle, tmp_path):
    sin, cos = math.sin(math.radians(angle)), math.cos(math.radians(angle))
    centres = np.array([[-0.4 * cos, 0.4 * sin], [0.25, 0.02]])[..., None].repeat(3, axis=-1)
    where = build_scene(clip(tmp_path, angle=angle), observed(centres)).surroundings
    assert where.has_table and where.comes_down == (True, False)
    path = np.asarray(where.start_path_m)
    assert path[0] < 0 < path[1]
    slopes = np.asarray(where.angle_rad), np.zeros(())
    position, velocity = to_plane(path, np.ones(2), *slopes, where)
    assert position == pytest.approx(np.asarray(where.start_m), abs=PLACE_ATOL_M)
    assert velocity == pytest.approx(np.array([[cos, -sin], [1.0, 0.0]]))


def test_the_way_is_as_far_as_object_1_is_seen_to_go(tmp_path):
    run = np.linspace(0, 0.8, 5) * np.array([[0.6], [-0.8]])
    declared = clip(tmp_path, scenario="incline", shapes=("box",))
    assert build_scene(declared, observed(run[None])).surroundings.way_m == pytest.approx(0.8)


def test_sizes_and_gravity_reach_the_model(tmp_path):
    times = np.array([0.0])
    centres = solve(HIT, times).position_m
    declared = clip(tmp_path, sizes=[(0.06, 0.05, 0.06), (0.07, 0.05, 0.05)])
    scene = build_scene(declared.model_copy(update={"gravity": 1.62}), observed(centres))
    assert scene.model.opt.gravity == pytest.approx([0, 0, -1.62])
    assert scene.surroundings.half_length_m == pytest.approx((0.03, 0.035))
    assert scene.surroundings.half_height_m == pytest.approx((0.03, 0.025))
    pairs = {scene.model.pair(i).name for i in range(scene.model.npair)}
    assert pairs == {"object1_ramp", "object1_table", "object2_table", "object1_object2"}


@pytest.mark.parametrize("count", [1, 3, 4])
def test_any_number_of_objects(count, tmp_path):
    """Each meets its surfaces and its neighbours."""
    x = [0.25 + 0.1 * i for i in range(count - 1)]
    centres = np.array([[-0.4, 0.2], *([place, 0.02] for place in x)])[..., None]
    declared = clip(tmp_path, "multi", shapes=("box",) * count)
    scene = build_scene(declared, observed(centres))
    assert scene.surroundings.comes_down == (True,) + (False,) * (count - 1)
    pairs = {scene.model.pair(i).name for i in range(scene.model.npair)}
    assert pairs == {"object1_ramp"} | {f"object{i + 1}_table" for i in range(count)} | {
        f"object{i}_object{i + 1}" for i in range(1, count)
    }
    data = mujoco.MjData(scene.model)  # pyright: ignore
    mujoco.mj_forward(scene.model, data)  # pyright: ignore
    assert data.xpos[1:, [0, 2]] == pytest.approx(np.array(scene.surroundings.start_m))
    assert all(abs(contact.dist) < 1e-6 for contact in data.contact)
    assert scene.model.body_mass[1:] == pytest.approx(0.5)


def test_objects_stand_in_the_order_of_the_travel(tmp_path):
    centres = np.array([[-0.4, 0.2], [0.4, 0.02], [0.3, 0.02]])[..., None]
    with pytest.raises(InputError, match=r"objects\[2\]: object3 stands before object2"):
        build_scene(clip(tmp_path, "multi", shapes=("box",) * 3), observed(centres))


def test_one_object_has_no_pair_with_a_second(tmp_path):
    centres = solve(HIT, np.array([0.0])).position_m[:1]
    scene = build_scene(clip(tmp_path, shapes=("box",)), observed(centres))
    assert scene.surroundings.has_table
    assert {scene.model.pair(i).name for i in range(scene.model.npair)} == {
        "object1_ramp",
        "object1_table",
    }


def test_incline_has_no_table_and_keeps_its_own_line(tmp_path):
    """Wherever the picture's origin lies, the board is under the object."""
    angle = math.radians(22)
    times = np.arange(30) / 60
    gone = 0.5 * 9.81 * (math.sin(angle) - 0.2 * math.cos(angle)) * times**2
    centres = np.array([[0.7 + gone * math.cos(angle), -0.3 - gone * math.sin(angle)]])
    observation = observed(centres, times)
    scene = build_scene(clip(tmp_path, "incline", 22.0, ("box",)), observation)
    assert not scene.surroundings.has_table
    assert scene.model.npair == 1
    model = Model(scene, 0.4, nuisances=())
    theta = np.array([[0.4, 0.2]])
    position, _ = EngineC(model).simulate(theta)
    moments = np.arange(position.shape[-1]) * model.record_dt_s
    exact = 0.5 * 9.81 * (math.sin(angle) - 0.2 * math.cos(angle)) * moments**2
    assert position[0, 0, 0] - 0.7 == pytest.approx(exact * math.cos(angle), abs=5e-4)
    assert position[0, 0, 1] + 0.3 == pytest.approx(-exact * math.sin(angle), abs=5e-4)


def test_release_of_an_incline_is_where_motion_begins(tmp_path):
    times = np.arange(60) / 60
    gone = np.where(times > 0.3, 0.5 * 2.0 * (times - 0.3) ** 2, 0.0)
    centres = np.array([[gone * 0.94, -gone * 0.34]])
    scene = build_scene(clip(tmp_path, "incline", 20.0, ("box",)), observed(centres, times))
    expected, sd = scene.surroundings.release_s
    assert expected == pytest.approx(0.3, abs=0.01)
    assert sd >= 3 / 60


def test_what_cannot_be_simulated_is_said(tmp_path):
    centres = solve(HIT, np.array([0.0])).position_m
    unseen = observed(centres)
    unseen.mask[1] = False
    with pytest.raises(InputError, match="object2 is not seen in any frame"):
        build_scene(clip(tmp_path), unseen)
