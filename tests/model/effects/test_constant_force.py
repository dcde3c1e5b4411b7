"""A level wind across a throw: told by how far gravity seems to be turned, and by nothing else."""

import numpy as np
import pytest

import galileo_jax as gx

SD_M = 1e-3
CLIP = "track: throw.csv\nscenario: flight\nobjects: [{name: object1, shape: sphere}]\n"


@pytest.fixture
def blow(tmp_path):
    """Writes a throw by (2.5, 4.0) m/s, 60 pictures/s, in a wind that pushes it, m/s^2."""

    def make(wind_m_s2):
        rng = np.random.default_rng(5)
        time = np.arange(45) / 60
        place = np.outer(time, [2.5, 4.0]) + np.outer(time**2 / 2, [wind_m_s2, -9.81])
        place += SD_M * rng.standard_normal(place.shape)
        np.savetxt(
            tmp_path / "throw.csv", np.column_stack([time, place]), "%.5f", ",",
            header="time_s,x_m,y_m", comments="",
        )  # fmt: skip
        path = tmp_path / "throw.yaml"
        path.write_text(CLIP)
        return path

    return make


def test_a_wind_stronger_than_a_camera_is_rolled_is_named(blow):
    verdict = gx.diagnose(blow(-1.2)).document["verdict"]
    assert verdict["status"] == "named"
    assert verdict["effects"] == ["constant_force"]


def test_a_faint_wind_may_be_a_rolled_camera(blow):
    verdict = gx.diagnose(blow(0.3)).document["verdict"]
    assert verdict["status"] == "ambiguous"
    assert {"camera_roll", "constant_force"} <= set(verdict["effects"])


def test_its_size_is_inferred_per_mass(blow):
    found = gx.fit(blow(-1.2), effects=["constant_force"]).result["derived"]
    per_mass = found["constant_force_per_mass"]
    assert abs(per_mass["mean"] + 1.2) < 4 * per_mass["sd"] < 0.4
