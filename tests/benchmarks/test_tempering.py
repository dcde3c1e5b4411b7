"""Tempered sequential Monte Carlo against densities whose posterior and evidence are known."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from benchmarks.tempering import temper

NUM_PARTICLES = 512
MONTE_CARLO = 5 / np.sqrt(NUM_PARTICLES)  # five standard errors


class Measured(eqx.Module):
    """`y` seen with a standard deviation of `sd`; or -y, where `is_folded`."""

    y: jax.Array
    sd: float
    is_folded: bool = eqx.field(static=True, default=False)

    def __call__(self, z):
        def log_normal(y):
            return jnp.sum(-0.5 * ((y - z) / self.sd) ** 2 - jnp.log(self.sd * np.sqrt(2 * np.pi)))

        if self.is_folded:
            return jnp.logaddexp(log_normal(self.y), log_normal(-self.y)) - jnp.log(2.0)
        return log_normal(self.y)


@pytest.mark.usefixtures("x64")
def test_a_narrow_gaussian_and_its_evidence():
    y, sd = jnp.array([1.5, -0.7]), 0.01
    found = temper(jax.random.key(0), Measured(y, sd), 2, num_particles=NUM_PARTICLES)
    width = sd / np.sqrt(1 + sd**2)
    assert np.all(np.abs(found.z.mean(0) - y / (1 + sd**2)) < MONTE_CARLO * width)
    assert np.allclose(found.z.std(0), width, rtol=0.15)
    exact = float(jnp.sum(-0.5 * y**2 / (1 + sd**2) - 0.5 * np.log(2 * np.pi * (1 + sd**2))))
    assert abs(found.log_evidence - exact) < 0.5
    assert found.temperatures[-1] == pytest.approx(1.0)
    assert all(a < b for a, b in zip(found.temperatures, found.temperatures[1:], strict=False))
    assert found.num_evaluations > NUM_PARTICLES * 10 * len(found.temperatures)


@pytest.mark.slow
@pytest.mark.usefixtures("x64")
def test_two_modes_are_both_found():
    density = Measured(jnp.array([1.0, 1.0]), 0.05, is_folded=True)
    found = temper(jax.random.key(1), density, 2, num_particles=NUM_PARTICLES)
    assert 0.3 < np.mean(found.z[:, 0] > 0) < 0.7
    assert np.all(np.sign(found.z[:, 0]) == np.sign(found.z[:, 1]))


@pytest.mark.usefixtures("x64")
def test_who_does_not_arrive_says_so():
    density = Measured(jnp.array([1.5, -0.7]), 0.01)
    with pytest.raises(RuntimeError, match=r"tempering has come to .* in 2 stages"):
        temper(jax.random.key(0), density, 2, num_particles=NUM_PARTICLES, max_stages=2)
