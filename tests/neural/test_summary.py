import dataclasses
import math

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from jax.scipy.special import ndtr

from galileo_jax.neural.seen import NUM_FRAMES, Seen
from galileo_jax.neural.summary import NUM_CHANNELS, NUM_FEATURES, Summary, summarise
from tests.ramp_model import HIT
from tests.reference_ramp import Experiment, solve

# Of estimates from clips without noise: what half a millimetre of doubt about what moves costs.
K1, K2, LOG_RATIO = 1e-4, 2e-3, 0.02

CASES = {
    "pushes on": HIT,
    "parts": dataclasses.replace(HIT, friction=(0.2, 0.08)),
    "heavy on light": dataclasses.replace(HIT, mass_kg=(0.9, 0.2)),
    "light on heavy": dataclasses.replace(HIT, mass_kg=(0.3, 0.6)),
    "steep": dataclasses.replace(HIT, angle_rad=math.radians(30), friction=(0.25, 0.3)),
    "flat": dataclasses.replace(HIT, angle_rad=math.radians(10), friction=(0.05, 0.15)),
}


def seen_of(experiment: Experiment, fps: float = 30.0, noise_m: float = 1e-5) -> Seen:
    times = np.arange(NUM_FRAMES) / fps
    half = np.array(experiment.size_m) / 2
    return Seen(
        times_s=jnp.asarray(times),
        position_m=jnp.asarray(solve(experiment, times).position_m),
        mask=jnp.ones((2, NUM_FRAMES), bool),
        noise_m=jnp.full(2, noise_m),
        angle_rad=jnp.asarray(experiment.angle_rad),
        gravity=jnp.asarray(experiment.gravity),
        half_length_m=jnp.asarray(half[:, 0]),
        half_height_m=jnp.asarray(half[:, 1]),
        is_ideal=jnp.ones(()),
        is_filmed=jnp.zeros(()),
        is_tracked_here=jnp.zeros(()),
    )


def run(seen: Seen) -> Summary:
    return _run(seen)


_run = jax.jit(summarise)


def check(summary: Summary, experiment: Experiment, times: float = 1.0) -> None:
    k1, k2 = np.asarray(ndtr(summary.centre))[[0, 2]]
    log_ratio = float(summary.centre[1]) * math.sqrt(2) * 0.7
    m1, m2 = experiment.mass_kg
    assert abs(k1 - experiment.friction[0]) < times * K1
    assert abs(k2 - experiment.friction[1]) < times * K2
    assert abs(log_ratio - math.log(m1 / m2)) < times * LOG_RATIO


@pytest.mark.parametrize("name", CASES)
def test_without_noise_the_closed_form_is_found_again(name, x64):
    summary = run(seen_of(CASES[name]))
    assert summary.moves and summary.is_hit
    assert summary.features.shape == (NUM_FEATURES,)
    assert summary.profile.shape == (NUM_CHANNELS, NUM_FRAMES)
    check(summary, CASES[name])


def test_frames_that_are_missing_do_not_matter(x64):
    seen = seen_of(HIT)
    mask = seen.mask.at[0, 5:9].set(False).at[1, 33:36].set(False)
    position = jnp.where(mask[:, None], seen.position_m, 0.0)
    check(run(seen._replace(mask=mask, position_m=position)), HIT, times=3)


def test_offsets_of_the_marked_points_do_not_matter_for_friction(x64):
    seen = seen_of(HIT)
    moved = seen.position_m + jnp.asarray([[[0.003], [-0.002]], [[-0.002], [0.001]]])
    summary = run(seen._replace(position_m=moved))
    assert abs(float(ndtr(summary.centre[0])) - 0.1) < 1e-3


def test_what_stands_and_what_is_not_hit_is_said(x64):
    stands = run(seen_of(dataclasses.replace(HIT, friction=(0.5, 0.2))))
    assert not stands.moves and not stands.is_hit
    missed = run(seen_of(dataclasses.replace(HIT, object2_x_m=1.5)))
    assert missed.moves and not missed.is_hit
    assert np.allclose(missed.centre[1:], 0) and np.allclose(missed.scale[1:], 1)
    assert abs(float(ndtr(missed.centre[0])) - 0.1) < 1e-4


def test_an_object_that_is_never_seen_leaves_numbers_finite(x64):
    seen = seen_of(HIT)
    mask = seen.mask.at[1].set(False)
    summary = run(seen._replace(mask=mask, position_m=jnp.where(mask[:, None], seen.position_m, 0)))
    assert all(np.isfinite(leaf).all() for leaf in jax.tree.leaves(summary))
    assert not summary.is_hit
