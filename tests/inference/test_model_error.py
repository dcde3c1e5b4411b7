"""What the simulator does not know, in the posterior.

The errors stand here as plain numbers, as the module's docstring promises them, and not imported.
"""

import numpy as np
import pytest

from galileo_jax.inference.model_error import add_model_error

IMPULSE_SD = 0.003  # of the impulse of a hit: "a few tenths of a per cent"
FRICTION_AFTER_HIT_SD = 0.006  # relative: "half a per cent"
FRICTION_SD = 1e-4  # of k1 itself
MOST_OF_A_MASS = 1.0  # of a mass's logarithm
NUM = 20_000
CLOSE = 0.03  # of an sd from so many draws


def widened(**values: float) -> dict[str, np.ndarray]:
    draws = np.tile(list(values.values()), (NUM, 1))
    return dict(zip(values, add_model_error(draws, tuple(values), seed=0).T, strict=True))


@pytest.mark.parametrize("ratio", [0.1, 1.0, 5.0])
def test_a_mass_ratio_is_known_as_far_as_the_impulse_is(ratio):
    """Plastic hits whose impulse is off, and what mass ratio somebody reads off who ignores it."""
    before = 1.7  # m/s
    off = 1 + IMPULSE_SD * np.random.default_rng(9).standard_normal(NUM)
    after = before * ratio / (1 + ratio) * off
    read = after / (before - after)
    found = widened(m1=ratio, k1=0.2, m2=1.0, k2=0.3)
    told = found["m1"] / found["m2"]
    assert np.log(told).std() == pytest.approx(np.log(read).std(), rel=2 * CLOSE)
    assert np.median(told) == pytest.approx(ratio, rel=2e-3)


def test_the_error_is_shared_by_both_masses():
    found = widened(m1=1.0, k1=0.2, m2=1.0, k2=0.3)
    assert np.log(found["m1"]).std() == pytest.approx(IMPULSE_SD, rel=CLOSE)
    np.testing.assert_allclose(found["m1"] * found["m2"], 1.0)


def test_friction_is_known_to_so_much():
    found = widened(m1=0.5, k1=0.2, m2=1.0, k2=0.3)
    assert found["k1"].std() == pytest.approx(FRICTION_SD, rel=CLOSE)
    assert found["k1"].mean() == pytest.approx(0.2, abs=5 * FRICTION_SD / np.sqrt(NUM))
    assert np.log(found["k2"]).std() == pytest.approx(FRICTION_AFTER_HIT_SD, rel=CLOSE)
    assert np.median(found["k2"]) == pytest.approx(0.3, rel=2e-4)
    assert abs(np.corrcoef(found["k2"], np.log(found["m1"]))[0, 1]) < 0.03, "errors of their own"


def test_the_same_seed_widens_alike():
    draws = np.full((50, 4), 0.4)
    names = ("m1", "k1", "m2", "k2")
    once, again, other = (add_model_error(draws, names, seed=s) for s in (3, 3, 4))
    np.testing.assert_array_equal(once, again)
    assert (once != other).all() and (draws == 0.4).all()


def test_each_of_three_has_its_own():
    found = widened(m1=1.0, k1=0.2, m2=2.0, k2=0.3, m3=0.5, k3=0.3)
    for (one, other), ratio in {("m1", "m2"): 0.5, ("m2", "m3"): 4.0}.items():
        spread = np.log(found[one] / found[other]).std()
        assert spread == pytest.approx(IMPULSE_SD * (1 + ratio), rel=CLOSE)


def test_what_is_not_slowed_at_all_may_be_of_any_mass():
    found = widened(m1=1e6, k1=0.2, m2=1e-6, k2=0.3)
    assert np.log(found["m1"]).std() == pytest.approx(MOST_OF_A_MASS, rel=CLOSE)


def test_friction_stays_friction():
    found = widened(m1=1.0, k1=1e-6, m2=1.0, k2=1 - 1e-6)
    assert found["k1"].min() > 0
    assert found["k2"].max() < 1
