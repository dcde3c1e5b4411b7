"""Free boxes in JAX: closed forms, conservation, motion in a plane, and MuJoCo's C engine."""

from dataclasses import replace

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from galileo_jax.clip.schema import ClipObject
from galileo_jax.model.effects.registry import make_effects
from galileo_jax.model.model import Model
from galileo_jax.rollout.engine_boxes import EngineBoxes, free_poses
from galileo_jax.rollout.engine_c_free import EngineCFree
from galileo_jax.rollout.engine_path import EnginePath
from galileo_jax.rollout.engines import make_engine
from galileo_jax.rollout.events import of_task
from galileo_jax.rollout.free_start import with_depths
from galileo_jax.runtime.errors import InputError
from tests.rollout.free_boxes import (
    FRICTION,
    MASS_KG,
    SIDE_M,
    SMOOTH,
    cubes,
    hit_record,
    model_of,
    yaw_rad,
)
from tests.rollout.objects import theta_of

PLANAR_ATOL_M = 5e-5  # a record in which something stops is a parabola that is cut short
YAW_RTOL = 1e-6
MOMENTUM_RTOL = 1e-4  # what is left of friction
KEPT_RTOL = 5e-3  # spin and energy, to second order in the step
# Of MuJoCo's contacts, which give way: bodies turn by some degrees until the faces have met.
C_ATOL_M, C_YAW_RAD = 0.012, 0.15
ROUGH_M = 1e-6
SLOPE_RTOL = 0.02  # of a polynomial through 21 of them
ALONE_ATOL_M = 1e-9
FINER_ATOL_M = 1e-4


FREE_POSES = jax.jit(of_task(free_poses), static_argnums=(0, 1, 2, 3))


def of_boxes(objects: list[ClipObject], *effects: str) -> Model:
    """With the same effects in most tests: they share compiled programs."""
    return model_of(objects, effects=make_effects(["restitution", *effects]))


def poses_of(model: Model, theta: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Places and velocities `[object, 3, record]` and quaternions."""
    effects, scene = model.effects + model.nuisances, with_depths(model.scene)
    found = FREE_POSES(
        effects, model.names, model.num_records + 1, model.record_dt_s, jnp.asarray(theta), scene
    )
    place, speed, turned = (np.asarray(own) for own in found)
    return place, speed, turned


def spins(turned: np.ndarray, dt_s: float) -> np.ndarray:
    return np.gradient(yaw_rad(turned), dt_s, axis=-1)


@pytest.mark.parametrize(("mass_kg", "friction"), [(MASS_KG, FRICTION), ((0.2, 0.6), (0.2, 0.1))])
def test_squarely_it_is_motion_in_a_plane(mass_kg, friction):
    model = of_boxes(cubes(), "air_drag")
    for given in ({}, {"air_drag": 0.05}, {"restitution": 0.4}):
        theta = theta_of(model, mass_kg, friction, **given)[None]
        position, _ = EngineBoxes(model).simulate(theta)
        expected, speed = EnginePath(model).simulate(theta)
        assert np.ptp(expected[0, 1, 0]) > 0.005, "object 2 is pushed on"
        hit = hit_record(speed[0])
        away = np.delete(np.arange(speed.shape[-1]), [hit - 1, hit, hit + 1])
        assert np.abs(position - expected)[..., away].max() < PLANAR_ATOL_M


@pytest.mark.parametrize("z_m", [0.01, -0.02, 0.03])
def test_a_hit_off_centre_turns_both(z_m):
    """As in test_engine_c_free: J (1/m1 + 1/m2 + y^2/I1 + (z - y)^2/I2) = v."""
    model = of_boxes(cubes(z_m))
    _, speed, turned = poses_of(model, theta_of(model, MASS_KG, SMOOTH))
    hit = hit_record(speed)
    (m1, m2), v = MASS_KG, speed[0, 0, hit - 2]
    inertia1, inertia2 = (m * SIDE_M**2 / 6 for m in MASS_KG)
    at = z_m * inertia1 / (inertia1 + inertia2)
    impulse = v / (1 / m1 + 1 / m2 + at**2 / inertia1 + (z_m - at) ** 2 / inertia2)
    # The hit is between two records; from the next on turning is even for a while.
    rate = np.diff(yaw_rad(turned)[:, hit : hit + 2])[:, 0] / model.record_dt_s
    assert rate[0] == pytest.approx(rate[1], rel=YAW_RTOL)
    # Later the faces slide on each other and turn the bodies faster.
    assert rate == pytest.approx(-impulse * at / inertia1, rel=0.05)


def test_momentum_spin_and_energy_are_kept():
    model = of_boxes(cubes(0.02))
    for restitution in (0.0, 1.0):
        theta = theta_of(model, MASS_KG, SMOOTH, restitution=restitution)
        place, speed, turned = poses_of(model, theta)
        hit, mass = hit_record(speed), np.array(MASS_KG)[:, None]
        later = slice(hit + 2, hit + 100)
        along, across = ((mass * speed[:, axis]).sum(axis=0) for axis in (0, 2))
        assert along[later] == pytest.approx(along[hit - 2], rel=MOMENTUM_RTOL)
        assert across[later] == pytest.approx(0.0, abs=MOMENTUM_RTOL * along[hit - 2])
        inertia, rate = mass * SIDE_M**2 / 6, spins(turned, model.record_dt_s)
        orbit = mass * (place[:, 2] * speed[:, 0] - place[:, 0] * speed[:, 2])
        spin = (orbit + inertia * rate).sum(axis=0)
        whole = MASS_KG[1] * 0.02 * speed[0, 0, hit - 2]
        assert spin[later] == pytest.approx(0.0, abs=KEPT_RTOL * whole)
        energy = 0.5 * (mass * (speed**2).sum(axis=1) + inertia * rate**2).sum(axis=0)
        if restitution == 1.0:
            assert energy[later] == pytest.approx(energy[hit - 2], rel=KEPT_RTOL)
        else:
            assert energy[hit + 2] < 0.9 * energy[hit - 2]


@pytest.mark.parametrize("z_m", [0.015, -0.03])
def test_mujoco_agrees(z_m):
    model = of_boxes(cubes(z_m))
    theta = theta_of(model, MASS_KG, FRICTION)
    place, _, turned = poses_of(model, theta)
    other = EngineCFree(model).poses(theta[None])
    assert np.abs(place - other.position_m[0]).max() < C_ATOL_M
    ends = yaw_rad(turned)[:, -1], yaw_rad(other.quaternion[0])[:, -1]
    assert np.abs(ends[0]).min() > 0.8
    assert ends[0] == pytest.approx(ends[1], abs=C_YAW_RAD)


@pytest.mark.parametrize("restitution", [0.0, 0.35, 0.9])
def test_restitution(restitution):
    model = of_boxes(cubes())
    theta = theta_of(model, MASS_KG, SMOOTH, restitution=restitution)
    _, velocity = EngineBoxes(model).simulate(theta[None])
    v, hit = velocity[0, :, 0], hit_record(velocity[0])
    assert (v[1, hit + 5] - v[0, hit + 5]) / v[0, hit - 2] == pytest.approx(restitution, abs=1e-6)


def test_a_tall_object_hit_at_its_foot_topples():
    low = ClipObject(name="object1", shape="box", size_m=(0.06, 0.06, 0.02))
    tall = ClipObject(name="object2", shape="box", size_m=(0.03, 0.06, 0.15))
    model = of_boxes([low, tall])
    place, speed, turned = poses_of(model, theta_of(model, MASS_KG, FRICTION))
    upright = 1 - 2 * (turned[1, 1] ** 2 + turned[1, 2] ** 2)
    assert upright[: hit_record(speed)] == pytest.approx(1.0)
    assert abs(upright[-1]) < 0.1, "it lies"
    assert place[1, 1, -1] == pytest.approx(0.015, abs=1e-4), "on its back"


def test_smooth_in_the_parameters_with_the_right_slopes():
    model = of_boxes(cubes(0.015))
    engine, share = EngineBoxes(model), np.linspace(-1, 1, 21)
    theta = np.stack([theta_of(model, MASS_KG, (0.1 + 5e-4 * s, 0.2)) for s in share])
    position, _ = engine.simulate(theta)
    k1 = jnp.zeros(theta.shape[1]).at[model.index("k1")].set(1.0)

    def ends(theta: jax.Array) -> jax.Array:
        return engine.traceable(theta[None])[0][0, :, 0, -1]

    _, slopes = jax.jvp(ends, (jnp.asarray(theta[10]),), (k1,))
    for end, slope in zip(position[:, :, 0, -1].T, slopes, strict=True):
        line = np.polynomial.Polynomial.fit(share, end, 4)
        assert np.ptp(end) > 1e-4
        assert end == pytest.approx(line(share), abs=ROUGH_M)
        assert line.deriv()(0.0) / 5e-4 == pytest.approx(float(slope), rel=SLOPE_RTOL)


@pytest.mark.slow
def test_finer_steps_change_little():
    coarse = of_boxes(cubes(-0.03))
    theta = theta_of(coarse, MASS_KG, FRICTION)
    scene = coarse.scene
    fine = replace(coarse, scene=replace(scene, timestep_s=scene.timestep_s / 3))
    ends = [EngineBoxes(model).simulate(theta[None])[0][0, :, 0, -1] for model in (coarse, fine)]
    assert ends[0] == pytest.approx(ends[1], abs=FINER_ATOL_M)


def test_a_batch_is_its_rollouts():
    """They hit at other times, one of them never; one has no numbers."""
    model = of_boxes(cubes(0.01))
    engine = EngineBoxes(model)
    frictions = [(0.05, 0.2), (0.15, 0.3), (0.36, 0.2), (np.nan, 0.2)]
    theta = np.stack([theta_of(model, MASS_KG, each) for each in frictions])
    position, _ = engine.simulate(theta)
    assert np.isnan(position[3, 0]).any()
    assert np.ptp(position[2, 1, 0]) == 0
    for i in range(3):
        alone, _ = engine.simulate(theta[i : i + 1])
        assert position[i] == pytest.approx(alone[0], abs=ALONE_ATOL_M)


@pytest.mark.slow
def test_three_boxes():
    third = ClipObject(name="object3", shape="box", size_m=(0.05, 0.05, 0.06), z_m=0.01)
    model = of_boxes([*cubes(), third])
    place, _, _ = poses_of(model, theta_of(model, (0.5, 0.3, 0.2), (0.1, 0.2, 0.2)))
    assert np.ptp(place[2, 0]) > 0.05
    assert np.ptp(place[2, 2]) > 0.001, "hit off centre it goes sideways"


def test_boxes_by_default_and_cylinders_by_mujoco():
    can = ClipObject(name="object2", shape="cylinder", size_m=(0.03, 0.06))
    assert make_engine("auto", model_of(cubes())).name == "rigid"
    assert make_engine("auto", model_of([cubes()[0], can])).name == "c"
    with pytest.raises(InputError, match="object2 is a cylinder; boxes expected, or c"):
        make_engine("rigid", model_of([cubes()[0], can]))
