"""What the simulator does not know, in the posterior."""

import numpy as np
import pytest

from galileo_jax.inference.model_error import (
    FRICTION_AFTER_HIT_SD,
    FRICTION_SD,
    IMPULSE_SD,
    MOST_OF_A_MASS,
    add_model_error,
)

NUM = 20_000
CLOSE = 0.03  # of an sd from so many draws


def widened(**values: float) -> dict[str, np.ndarray]:
    draws = np.tile(list(values.values()), (NUM, 1))
    return dict(zip(values, add_model_error(draws, tuple(values), seed=0).T, strict=True))


@pytest.mark.parametrize("ratio", [0.1, 1.0, 5.0])
def test_an_impulse_known_to_so_much(ratio):
    """v' = v R / (1 + R): a relative error of v' is one of (1 + R) times it in R."""
    found = widened(m1=ratio, k1=0.2, m2=1.0, k2=0.3)
    told = found["m1"] / found["m2"]
    after_hit = np.log(told / (1 + told))
    assert after_hit.std() == pytest.approx(IMPULSE_SD, rel=CLOSE)
    assert found["k1"].std() == pytest.approx(FRICTION_SD, rel=CLOSE)
    assert np.log(found["k2"]).std() == pytest.approx(FRICTION_AFTER_HIT_SD, rel=CLOSE)


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
