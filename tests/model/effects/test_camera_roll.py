"""A rolled camera: a throw whose gravity is not the picture's vertical."""

import math

import numpy as np
import pytest

import galileo_jax as gx
from galileo_jax.clip.scenarios import SCENARIOS

ROLL_RAD, SD_M = math.radians(1.7), 5e-4
CLIP = "track: throw.csv\nscenario: flight\nobjects: [{name: object1, shape: sphere}]\n"


@pytest.fixture
def throw(tmp_path):
    """A throw by (2.0, 3.7) m/s, 60 pictures/s, that falls along gravity turned forward."""
    rng = np.random.default_rng(0)
    time = np.arange(45) / 60
    pull = 9.81 * np.array([math.sin(ROLL_RAD), -math.cos(ROLL_RAD)])
    place = np.outer(time, [2.0, 3.7]) + np.outer(time**2 / 2, pull)
    place += SD_M * rng.standard_normal(place.shape)
    np.savetxt(
        tmp_path / "throw.csv", np.column_stack([time, place]), "%.5f", ",",
        header="time_s,x_m,y_m", comments="",
    )  # fmt: skip
    path = tmp_path / "throw.yaml"
    path.write_text(CLIP)
    return path


def test_the_roll_is_inferred_with_its_sign(throw):
    found = gx.fit(throw, effects=["camera_roll"]).result["parameters"]["camera_roll"]
    assert found["sd"] < math.radians(0.3)
    assert abs(found["mean"] - ROLL_RAD) < 4 * found["sd"]


def test_a_declared_error_of_the_vertical_stands_for_it(throw):
    throw.write_text(CLIP + "vertical_sd_deg: 2\n")
    result = gx.fit(throw, effects=[]).result
    nuisance = result["nuisances"]["declared_angle"]
    assert abs(nuisance["mean"] - ROLL_RAD) < 4 * nuisance["sd"]


def test_what_is_seen_from_above_or_by_several_cameras_has_no_vertical_to_be_off():
    has_vertical = {name for name, one in SCENARIOS.items() if "vertical_sd_deg" in one.keys}
    in_plane = {name for name, one in SCENARIOS.items() if one.moves_in_plane}
    assert {name for name in in_plane if "camera_roll" not in SCENARIOS[name].without} == (
        has_vertical
    )
