"""The coefficient of restitution that a parameter names is the one the bumpers give."""

from dataclasses import replace

import numpy as np
import pytest

from galileo_jax.rollout.engine_c import EngineC
from tests.ramp_model import SMOOTH, make_model, make_theta

# Contacts know stiffness and damping, not e; the table was measured at 0.3 and 1 m/s.
RESTITUTION_ATOL = 0.03
MASSES = ((0.5, 0.3), (0.9, 0.15), (1.2, 1.0))  # object 1 the heavier: it never goes back


@pytest.mark.parametrize("wanted", [0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9])
def test_restitution(wanted):
    experiment = replace(SMOOTH, release_m=0.15)  # hits at 0.9 m/s
    engine = EngineC(make_model(experiment, 1.0))
    theta = np.stack(
        [
            make_theta(
                engine.model, replace(experiment, mass_kg=mass), {"impact_restitution": wanted}
            )
            for mass in MASSES
        ]
    )
    velocity = engine.simulate(theta)[1][:, :, 0]
    before, after = velocity[:, 0].max(axis=1), velocity[:, :, -1]
    assert (after[:, 1] > 0.1).all(), "object 2 was hit"
    assert (after[:, 1] - after[:, 0]) / before == pytest.approx(wanted, abs=RESTITUTION_ATOL)
