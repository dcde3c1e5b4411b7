"""What the network's world draws is what the fit's likelihood allows for."""

import dataclasses
import functools

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from galileo_jax.measurement.errors_at_rest import SHIFT_SHARE
from galileo_jax.neural.film import Bodies, measured, noisy
from galileo_jax.observation.observation import Observation
from galileo_jax.similarity.discrepancy import modes
from tests.ramp_model import HIT, make_surroundings
from tests.reference_ramp import solve

NUM_DRAWS, FPS, FRAMES = 2000, 120.0, 200
# Of a standard deviation: by 2,000 draws 2 %; the rest, what two ways to integrate a push differ.
TOLERANCE = 0.12
NOISE_M = 1e-4
CASES = {
    "apart": dataclasses.replace(HIT, friction=(0.12, 0.08)),
    "fast": dataclasses.replace(HIT, friction=(0.2, 0.05)),
}


def normals(key):
    keys = iter(jax.random.split(key, 60))
    return lambda shape=(): jax.random.normal(next(keys), shape)


@jax.jit
@functools.partial(jax.vmap, in_axes=(0, None, None, None, None, None))
def drawn(key, exact, times, bodies, is_filmed, is_tracked_here):
    """What a film adds to places: one program for all cases."""
    return measured(exact, times, bodies, is_filmed, is_tracked_here, normals(key)) - exact


def motion(experiment) -> tuple[np.ndarray, np.ndarray]:
    times = np.arange(FRAMES) / FPS
    return times, solve(experiment, times).position_m


@pytest.mark.parametrize("is_tracked_here", [True, False])
@pytest.mark.parametrize("is_filmed", [True, False])
@pytest.mark.parametrize("case", CASES)
def test_what_is_drawn_is_as_large_as_what_is_allowed_for(case, is_filmed, is_tracked_here, x64):
    experiment = CASES[case]
    times, exact = motion(experiment)
    scene = dataclasses.replace(make_surroundings(experiment), is_scale_stated=True)
    bodies = Bodies(
        jnp.asarray(scene.angle_rad),
        jnp.asarray(scene.half_length_m),
        jnp.asarray(scene.corner_m[0]),
        jnp.asarray(experiment.mass_kg),
    )
    keys = jax.random.split(jax.random.key(0), NUM_DRAWS)
    kind = jnp.asarray(1.0 * is_filmed), jnp.asarray(1.0 * is_tracked_here)
    extra = np.asarray(drawn(keys, jnp.asarray(exact), jnp.asarray(times), bodies, *kind))
    covariance = np.broadcast_to(1e-16 * np.eye(2)[None, ..., None], (2, 2, 2, FRAMES)).copy()
    observation = Observation(
        names=("object1", "object2"),
        times_s=times,
        position_m=exact,
        covariance_m2=covariance,
        mask=np.ones((2, FRAMES), bool),
        noise_known_to=0.1 if is_tracked_here else 0.0,
    )
    allowed = modes(observation, scene, is_filmed, rough_sd_m=0.0)
    # Along x; offsets of a whole track are wider in the likelihood, and displacements lack them.
    for rows in (extra[:, 0, 0], extra[:, 1, 0], extra[:, 1, 0] - extra[:, 0, 0]):
        assert np.isfinite(rows).all()
    for of in (lambda e: e[:, 0, 0], lambda e: e[:, 1, 0], lambda e: e[:, 1, 0] - e[:, 0, 0]):
        one = of(extra) - of(extra)[:, :1]
        other = of(allowed) - of(allowed)[:, :1]
        expected = np.sqrt(np.sum(other**2, axis=0))
        found = one.std(axis=0)
        late = expected > 4e-5  # the likelihood leaves the smallest of its patterns out
        assert late.any()
        np.testing.assert_allclose(found[late], expected[late], rtol=TOLERANCE, atol=1e-5)


def test_a_rest_scatters_less_and_is_shifted_once(x64):
    times, exact = motion(HIT)
    noise, scatter = jnp.full(2, NOISE_M), jnp.asarray(0.4)

    def drawn(key):
        position = jnp.asarray(exact)
        return noisy(position, position, jnp.asarray(times), noise, scatter, normals(key)) - exact

    errors = np.asarray(jax.jit(jax.vmap(drawn))(jax.random.split(jax.random.key(1), NUM_DRAWS)))
    before = exact[1, 0] == exact[1, 0, 0]
    rest = errors[:, 1, 0, before]
    assert rest.std(axis=1).mean() == pytest.approx(0.4 * NOISE_M, rel=0.05)
    moving = ~before & (np.gradient(exact[1, 0]) > 1e-4)
    assert errors[:, 1, 0, moving].std(axis=1).mean() == pytest.approx(NOISE_M, rel=0.05)
    last = errors[:, 1, 0, -1]
    shift = rest.mean(axis=1)
    expected = np.sqrt(SHIFT_SHARE * (1 - 0.4**2)) * NOISE_M
    assert shift.std() == pytest.approx(expected, rel=0.1)
    assert abs(np.corrcoef(shift, last)[0, 1]) < 0.1
