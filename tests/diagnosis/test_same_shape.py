"""A candidate is tried with the leader's place: between the tried shapes a narrow one is missed."""

from types import SimpleNamespace
from typing import Any

import jax.numpy as jnp
import numpy as np
import pytest

from galileo_jax.diagnosis.candidate_starts import alike_or_matched
from galileo_jax.model.parameters import Normal, Parameter, Uniform

FRICTION, START, BRAKE, BRAKE_START, BRAKE_RATE, DRAG = range(6)
PLACE, STRENGTH = 0.3, 1.2  # metres along the way; of the brake, where the cost is least


class NarrowValley:
    """The brake costs little only within millimetres of one place, and at one strength."""

    def __init__(self) -> None:
        unit, at_zero = Normal(0.0, 1.0), 0.0
        parameters = [
            Parameter("friction_patch", "1", unit, at_zero),
            Parameter("friction_patch_start", "m", Uniform(0.0, 1.0), at_zero),
            Parameter("magnetic_brake", "1", unit, at_zero),
            Parameter("magnetic_brake_start", "m", Uniform(-0.5, 1.5), at_zero),
            Parameter("magnetic_brake_rate", "1", Uniform(0.0, 1.0), at_zero),
            Parameter("air_drag", "1", unit, at_zero),
        ]
        self.trials = SimpleNamespace(model_parameters=parameters, brought_by=self.brought_by)

    def brought_by(self, effect: str) -> np.ndarray:
        of = {"friction_patch": (0, 1), "magnetic_brake": (2, 3, 4), "air_drag": (5,)}
        return np.array(of[effect])

    def search_costs(self, z: np.ndarray, free: np.ndarray) -> np.ndarray:
        assert z.shape == free.shape
        off = (z[:, BRAKE_START] - _z_of(self.trials.model_parameters[BRAKE_START], PLACE)) / 0.01
        return 100.0 - 90.0 * np.exp(-(off**2)) * np.exp(-((z[:, BRAKE] - STRENGTH) ** 2))


def _z_of(parameter: Parameter, value: float) -> float:
    return float(parameter.prior.inverse(np.asarray(value)))


def _leading(place: float) -> Any:
    z = np.zeros(6)
    z[FRICTION] = 0.8
    z[START] = _z_of(NarrowValley().trials.model_parameters[START], place)
    return SimpleNamespace(z=z)


def _starts(place: float) -> tuple[np.ndarray, np.ndarray]:
    fitter: Any = NarrowValley()
    matching = np.tile(np.linspace(0.1, 0.6, 6), (2, 1))
    free = np.ones((2, 6), bool)
    effects = ["magnetic_brake", "air_drag"]
    found = alike_or_matched(fitter, _leading(place), "friction_patch", matching, free, effects)
    return matching, found


def test_a_candidate_takes_the_leaders_place_in_metres_and_the_best_strength_there():
    matching, found = _starts(PLACE)
    prior = Uniform(-0.5, 1.5)  # the same place is another z than the leader's
    assert float(prior.forward(jnp.asarray(found[0, BRAKE_START]))) == pytest.approx(
        PLACE, abs=1e-5
    )
    assert found[0, BRAKE] == pytest.approx(STRENGTH, abs=2e-3)
    same = [FRICTION, START, BRAKE_RATE, DRAG]  # the leader has no rate to take over
    np.testing.assert_array_equal(found[0, same], matching[0, same])


def test_where_the_leaders_place_costs_more_the_start_stays():
    matching, found = _starts(0.7)
    np.testing.assert_array_equal(found[0], matching[0])


def test_a_candidate_without_a_place_starts_as_before():
    matching, found = _starts(PLACE)
    np.testing.assert_array_equal(found[1], matching[1])
