"""Forces are told per mass where nobody weighed the objects, and as they are where somebody did."""

from dataclasses import replace

import numpy as np
import pytest

from galileo_jax.inference.joint_problem import JointProblem
from galileo_jax.inference.per_mass import force_constants, per_mass_unit
from galileo_jax.inference.posterior import Posterior, Status
from galileo_jax.inference.result import make_result
from galileo_jax.model.effects.registry import make_effects
from tests.oracle_trials import make_trials
from tests.precision import in_64_bit
from tests.ramp_model import HIT

PER_MASS = 1.25  # 1/m
SD_Z = 0.01


def weighed(trials: JointProblem) -> JointProblem:
    """The same, both objects on the scales before."""
    (problem,) = trials.problems
    scene = problem.model.scene
    known = replace(scene.surroundings, mass_kg=HIT.mass_kg)
    model = replace(problem.model, scene=replace(scene, surroundings=known))
    return JointProblem((replace(problem, model=model),))


def result_of(trials: JointProblem):
    """Draws that know c / m1 and m1 / m2 to a per cent, and of m1 what the prior says."""
    generator = np.random.default_rng(0)
    names = trials.names
    z = SD_Z * generator.standard_normal((1000, len(names)))
    z[:, names.index("m1")] = generator.standard_normal(1000)
    theta = np.array(trials.theta(z))
    mass = theta[:, names.index("m1")]
    theta[:, names.index("m2")] = 0.6 * mass * (1 + SD_Z * generator.standard_normal(1000))
    spread = 1 + SD_Z * generator.standard_normal(1000)
    theta[:, names.index("air_drag")] = PER_MASS * mass * spread
    posterior = Posterior(names, theta[None], np.zeros((1, 1000)), Status.CONVERGED)
    return make_result(
        trials, posterior, z[0], clips=[], method="grad", seed=0, timings_s={}, notes={}
    )


@pytest.fixture(scope="module")
def trials():
    with in_64_bit():
        return make_trials([HIT], effects=make_effects(["air_drag", "friction_patch"]))


def test_without_a_mass_only_the_strength_per_mass_is_told(trials):
    with in_64_bit():
        result = result_of(trials)
    assert not result["parameters"]["air_drag"]["identified"]
    told = result["derived"]["air_drag_per_mass"]
    assert told["identified"] and told["unit"] == "1/m"
    assert told["mean"] == pytest.approx(PER_MASS, rel=0.01)
    assert told["q975"] - told["q025"] < 0.06 * PER_MASS
    assert result["parameters"]["friction_patch"]["identified"], "is no force"
    assert "friction_patch_per_mass" not in result["derived"]


def test_of_weighed_objects_the_strength_itself_is_told(trials):
    with in_64_bit():
        result = result_of(weighed(trials))
    assert result["parameters"]["air_drag"]["identified"]
    assert "air_drag_per_mass" not in result["derived"]


def test_only_constants_of_forces_count(trials):
    assert force_constants(trials) == {"air_drag": "1/m"}


@pytest.mark.parametrize(
    ("unit", "told"),
    [
        ("kg/m", "1/m"),
        ("N/m", "1/s^2"),
        ("N", "m/s^2"),
        ("N s^2/m^2", "N s^2/m^2/kg"),
        ("m/s", None),
        ("1", None),
        ("m/s^2", None),
    ],
)
def test_units(unit, told):
    assert per_mass_unit(unit) == told
