import jax
import jax.numpy as jnp
import numpy as np
from flax import nnx

from galileo_jax.neural.posterior_network import PosteriorNetwork, from_u, to_u

FEATURES, CHANNELS, FRAMES = 7, 3, 16


def network() -> PosteriorNetwork:
    return PosteriorNetwork(FEATURES, CHANNELS, FRAMES, nnx.Rngs(0))


def clip():
    features = jax.random.normal(jax.random.key(1), (1, FEATURES))
    profile = jax.random.normal(jax.random.key(2), (1, CHANNELS, FRAMES))
    return features, profile


def test_every_conditional_density_integrates_to_one():
    one = network()
    trunk = one.trunk(*clip())
    u = jnp.linspace(-40, 40, 20001)
    for i in range(3):
        before = jnp.full((1, i), 0.3)
        mixture = one.mixture(i, trunk, before)
        density = jnp.exp(mixture.log_density(u[:, None]))[:, 0]
        assert np.isclose(np.trapezoid(density, u), 1, atol=1e-3)


def test_draws_have_the_density_that_is_told():
    one = network()
    features, profile = clip()
    u = np.asarray(one.draw(jax.random.key(0), features, profile, 20000))[0]
    trunk = one.trunk(features, profile)
    grid = np.linspace(-40, 40, 20001)
    mixture = one.mixture(0, trunk, jnp.zeros((1, 0)))
    density = np.exp(np.asarray(mixture.log_density(jnp.asarray(grid)[:, None])))[:, 0]
    mean = np.trapezoid(density * grid, grid)
    sd = np.sqrt(np.trapezoid(density * (grid - mean) ** 2, grid))
    assert abs(u[:, 0].mean() - mean) < 4 * sd / np.sqrt(len(u))
    assert abs(u[:, 0].std() / sd - 1) < 0.05


def test_later_numbers_depend_on_earlier_ones():
    one = network()
    features, profile = clip()
    first, second = (
        one.log_density(features, profile, jnp.asarray([[value, 0.0, 0.0]]))[0, 2]
        for value in (0.0, 2.0)
    )
    assert first != second


def test_the_targets_space_is_invertible(x64):
    t, centre, scale = jnp.asarray([0.4, -2.0]), jnp.asarray([0.5, 1.0]), jnp.asarray([1e-4, 0.3])
    assert np.allclose(from_u(to_u(t, centre, scale), centre, scale), t)


def test_far_features_are_far():
    one = network()
    near, far = one.distance(jnp.zeros(FEATURES)), one.distance(jnp.full(FEATURES, 5.0))
    assert near == 0 and np.isclose(far, 5.0)
