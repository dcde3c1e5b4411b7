"""Bodies that move freely: as in the plane where they meet squarely, by closed forms elsewhere."""

import os
import subprocess
import sys

import numpy as np
import pytest

from galileo_jax.clip.schema import ClipObject
from galileo_jax.model.effects.registry import make_effects
from galileo_jax.rollout.engine_c_free import EngineCFree
from galileo_jax.rollout.engine_path import EnginePath
from galileo_jax.rollout.engines import make_engine
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
from tests.rollout.objects import BALL, theta_of

# Against motion in a plane, away from the hit: it makes a box rock on its edges by 0.1 mm.
PLANAR_ATOL_M, PLANAR_ATOL_M_S, AFTER_HIT_S = 0.001, 0.005, 0.12
YAW_RTOL, SPEED_ATOL_M_S = 0.01, 0.006  # bodies turn by some degrees until the faces have met
MOMENTUM_RTOL = 1e-4  # what is left of friction
SPIN_RTOL = 0.01
RESTITUTION_ATOL = 0.02  # it depends on the speed by 0.03 at most
ROUGH_M = 1e-5
ALONE_ATOL_M = 1e-9


def poses_of(objects, friction=FRICTION, mass_kg=MASS_KG, **given):
    """The model, its poses for one parameter vector, and the first record after the hit."""
    model = model_of(objects)
    poses = EngineCFree(model).poses(theta_of(model, mass_kg, friction, **given)[None])
    return model, poses, hit_record(poses.velocity_m_s[0])


@pytest.mark.parametrize(("mass_kg", "friction"), [(MASS_KG, FRICTION), ((0.2, 0.6), (0.2, 0.1))])
def test_agrees_with_motion_in_a_plane(mass_kg, friction):
    model = model_of(cubes())
    theta = theta_of(model, mass_kg, friction)[None]
    position, velocity = EngineCFree(model).simulate(theta)
    expected, speed = EnginePath(model).simulate(theta)
    hit = int(np.argmax(speed[0, 1, 0] > 0.01))
    assert np.ptp(expected[0, 1, 0]) > 0.01, "object 2 is pushed on"
    after = np.arange(speed.shape[-1]) >= hit + round(AFTER_HIT_S / model.record_dt_s)
    away = after | (np.arange(speed.shape[-1]) < hit - 1)
    assert np.abs(position - expected)[..., away].max() < PLANAR_ATOL_M
    assert np.abs(velocity - speed)[..., away].max() < PLANAR_ATOL_M_S


def test_an_effect_acts_on_free_bodies():
    """Drag, after the hit too, as in a plane."""
    model = model_of(cubes(), effects=make_effects(["air_drag"]))
    without = theta_of(model, MASS_KG, FRICTION)
    drag = without.copy()
    drag[model.index("air_drag")] = 0.3
    free, _ = EngineCFree(model).simulate(np.stack([without, drag]))
    planar, _ = EnginePath(model).simulate(np.stack([without, drag]))
    moved = np.abs(planar[1] - planar[0])[:, 0, -1]
    assert moved.min() > 0.02
    assert np.abs(free - planar)[..., -1].max() < PLANAR_ATOL_M


@pytest.mark.parametrize("z_m", [0.01, -0.02, 0.03])
def test_a_hit_off_centre_turns_both(z_m):
    """A plastic impact of smooth faces: one impulse, at y = z I1 / (I1 + I2), and both turn alike.

    J (1/m1 + 1/m2 + y^2/I1 + (z - y)^2/I2) = v,   I = m s^2 / 6.
    """
    _, poses, hit = poses_of(cubes(z_m), SMOOTH)
    (m1, m2), v = MASS_KG, poses.velocity_m_s[0, 0, 0, hit - 2]
    inertia1, inertia2 = (m * SIDE_M**2 / 6 for m in MASS_KG)
    at = z_m * inertia1 / (inertia1 + inertia2)
    impulse = v / (1 / m1 + 1 / m2 + at**2 / inertia1 + (z_m - at) ** 2 / inertia2)
    rate = np.gradient(yaw_rad(poses.quaternion[0]), 1 / 240, axis=-1)
    # At once: later the faces slide on each other and turn the bodies faster.
    assert rate[:, hit + 1] == pytest.approx(-impulse * at / inertia1, rel=5 * YAW_RTOL)
    assert rate[0, hit + 1] == pytest.approx(rate[1, hit + 1], rel=YAW_RTOL)
    assert poses.velocity_m_s[0, 0, 0, hit + 1] == pytest.approx(v - impulse / m1, abs=0.03)


def test_momentum_and_spin_are_kept():
    _, poses, hit = poses_of(cubes(0.02), SMOOTH)
    mass = np.array(MASS_KG)[:, None]
    along = (mass * poses.velocity_m_s[0, :, 0]).sum(axis=0)
    across = (mass * poses.velocity_m_s[0, :, 2]).sum(axis=0)
    later = slice(hit + 2, hit + 100)
    assert along[later] == pytest.approx(along[hit - 2], rel=MOMENTUM_RTOL)
    assert across[later] == pytest.approx(0.0, abs=MOMENTUM_RTOL * along[hit - 2])
    # About the vertical through the origin; z points to the camera, yaw is seen from above.
    rate = np.gradient(yaw_rad(poses.quaternion[0]), 1 / 240, axis=-1)
    orbit = (
        poses.position_m[0, :, 2] * poses.velocity_m_s[0, :, 0]
        - poses.position_m[0, :, 0] * poses.velocity_m_s[0, :, 2]
    )
    spin = (mass * (orbit + SIDE_M**2 / 6 * rate)).sum(axis=0)
    whole = MASS_KG[1] * 0.02 * poses.velocity_m_s[0, 0, 0, hit - 2]
    assert spin[later] == pytest.approx(0.0, abs=SPIN_RTOL * whole)


def test_a_mirrored_hit_is_mirrored():
    one, other = (poses_of(cubes(z))[1] for z in (0.015, -0.015))
    assert one.position_m[:, :, :2] == pytest.approx(other.position_m[:, :, :2], abs=1e-4)
    assert one.position_m[:, :, 2] == pytest.approx(-other.position_m[:, :, 2], abs=1e-4)
    assert np.abs(one.position_m[0, 1, 2, -1]) > 0.016, "and goes sideways"


def test_a_tall_object_hit_at_its_foot_topples():
    low = ClipObject(name="object1", shape="box", size_m=(0.06, 0.06, 0.02))
    tall = ClipObject(name="object2", shape="box", size_m=(0.03, 0.06, 0.15))
    _, poses, hit = poses_of([low, tall])
    _, x, y, _ = poses.quaternion[0, 1]
    upright = 1 - 2 * (x**2 + y**2)
    assert upright[:hit].min() == 1.0
    assert upright[-1] < 0.1, "it lies"
    assert poses.position_m[0, 1, 1, -1] == pytest.approx(0.015, abs=1e-4), "on its back"


@pytest.mark.parametrize("restitution", [0.0, 0.1, 0.35, 0.7, 0.9])
@pytest.mark.parametrize("release_m", [0.05, 0.5])
def test_restitution(restitution, release_m):
    model = model_of(cubes(), effects=make_effects(["restitution"]), release_m=release_m)
    theta = theta_of(model, MASS_KG, SMOOTH, restitution=restitution)
    poses = EngineCFree(model).poses(theta[None])
    hit, v = hit_record(poses.velocity_m_s[0]), poses.velocity_m_s[0, :, 0]
    measured = (v[1, hit + 18] - v[0, hit + 18]) / v[0, hit - 2]
    assert measured == pytest.approx(restitution, abs=RESTITUTION_ATOL)


def test_a_batch_is_its_rollouts():
    """They hit at other times, one of them never; one has no numbers."""
    model = model_of(cubes(0.01), 1.2)
    engine = EngineCFree(model)
    frictions = [(0.05, 0.2), (0.15, 0.3), (0.36, 0.2), (np.nan, 0.2)]
    theta = np.stack([theta_of(model, MASS_KG, each) for each in frictions])
    position, _ = engine.simulate(theta)
    assert np.isnan(position[3]).all()
    assert np.ptp(position[2, 1, 0]) == 0
    for i in range(3):
        alone, _ = engine.simulate(theta[i : i + 1])
        assert position[i] == pytest.approx(alone[0], abs=ALONE_ATOL_M)


def test_smooth_in_the_parameters():
    """Steps begin with the hit, not with the clock: no kinks where it crosses into another step."""
    model = model_of(cubes(0.015))
    share = np.linspace(-1, 1, 21)
    theta = [theta_of(model, MASS_KG, (0.1 + 0.0015 * s, 0.2)) for s in share]
    position, _ = EngineCFree(model).simulate(np.stack(theta))
    for end in position[:, :, 0, -1].T:
        line = np.polynomial.Polynomial.fit(share, end, 3)
        assert np.ptp(end) > 1e-3
        assert end == pytest.approx(line(share), abs=ROUGH_M)


def test_three_objects_and_a_cylinder():
    can = ClipObject(name="object3", shape="cylinder", size_m=(0.03, 0.06), z_m=0.01)
    model = model_of([*cubes(), can])
    poses = EngineCFree(model).poses(theta_of(model, (0.5, 0.3, 0.2), (0.1, 0.2, 0.2))[None])
    assert np.ptp(poses.position_m[0, 2, 0]) > 0.05
    assert np.ptp(poses.position_m[0, 2, 2]) > 0.001, "the can, hit off centre, goes sideways"


def test_what_it_cannot_do_is_said():
    with pytest.raises(InputError, match="two objects that meet on a table expected"):
        make_engine("auto", model_of(cubes()[:1]))
    with pytest.raises(InputError, match="nothing may roll"):
        make_engine("auto", model_of([cubes()[0], BALL]))
    with pytest.raises(InputError, match=r"face is 0\.050 m past the foot.*0\.075 m or more"):
        make_engine("auto", model_of(cubes(), beyond_m=[0.08]))
    with pytest.raises(
        InputError, match="'mjx' moves objects in a plane; --motion free is of rigid"
    ):
        make_engine("mjx", model_of(cubes()))


ON_ONE_CORE = """
import os
os.sched_setaffinity(0, {min(os.sched_getaffinity(0))})
from galileo_jax.runtime.jax_setup import set_up
set_up()
import jax
import jax.numpy as jnp
from galileo_jax.inference.samplers.driver import Settings, sample
from galileo_jax.inference.samplers.sampler import SAMPLERS
from galileo_jax.rollout.engine_c_free import EngineCFree
from galileo_jax.rollout.rollout import in_jax
from tests.rollout.objects import theta_of
from tests.rollout.free_boxes import FRICTION, MASS_KG, cubes, model_of
model = model_of(cubes())
theta = jnp.asarray(theta_of(model, MASS_KG, FRICTION))

def log_density(z):
    position, _ = in_jax(EngineCFree(model))((theta + 1e-3 * z)[None])
    return -0.5 * jnp.sum(z**2) - 0.5 * jnp.sum((position[0, :, 0, -1] - 0.3) ** 2)

dim = len(theta)
sampler = SAMPLERS.get("mixture").from_gaussian(jnp.zeros(dim), jnp.eye(dim))
steps = Settings(warmup_steps=0, block_steps=5, max_steps=5, stops_early=False)
names = [f"z{i}" for i in range(dim)]
sample(jax.random.key(0), sampler, log_density, jnp.zeros((4, dim)), names, settings=steps)
"""


@pytest.mark.skipif(not hasattr(os, "sched_setaffinity"), reason="cores cannot be chosen")
def test_called_back_on_one_core_it_ends():
    """It runs JAX in a callback of JAX: one would wait for the thread of the other."""
    subprocess.run([sys.executable, "-c", ON_ONE_CORE], check=True, timeout=120)
