"""Places that are known along a line only: one number each; what is not measured is none."""

from dataclasses import replace

import numpy as np

import galileo_jax as gx
from galileo_jax.observation.observation import UNMEASURED_SD_M
from galileo_jax.similarity.gaussian_likelihood import (
    inverse_root_of,
    is_measured,
    whitening_of,
)
from tests.oracle_trials import observe
from tests.ramp_model import HIT

ANGLE, SD_M = np.radians(31.0), 1e-4
ALONG = np.array([np.cos(ANGLE), -np.sin(ANGLE)])
ACROSS = np.array([np.sin(ANGLE), np.cos(ANGLE)])
YAML = """
track: slide.csv
scenario: incline
ramp_angle_deg: 31
objects: [{name: object1, shape: box, mass_kg: 0.2}]
"""


def along_a_line():
    """A track whose places are known along a slope, to a tenth of a millimetre."""
    seen = observe(HIT, 0)
    cover = SD_M**2 * np.outer(ALONG, ALONG) + UNMEASURED_SD_M**2 * np.outer(ACROSS, ACROSS)
    shape = seen.covariance_m2.shape
    return replace(seen, covariance_m2=np.broadcast_to(cover[None, ..., None], shape).copy())


def test_the_one_number_is_the_place_along_the_line_in_its_error():
    root = inverse_root_of(along_a_line())
    assert (is_measured(root) == [[True], [False]]).all()
    np.testing.assert_allclose(
        np.einsum("oijt,j->oit", root, SD_M * ALONG)[:, 0] ** 2, 1, rtol=1e-4
    )
    np.testing.assert_allclose(np.einsum("oijt,j->oit", root, ACROSS), 0, atol=1e-6)


def test_modes_take_up_no_more_than_was_measured():
    """With as many modes as coordinates noise is told by nothing, and never by less."""
    seen = along_a_line()
    count, axes, frames = seen.position_m.shape
    every = 1e-2 * np.eye(count * axes * frames).reshape(-1, count, axes, frames)
    root = inverse_root_of(seen)
    data = whitening_of(seen, root, np.einsum("oijt,mojt->moit", root, every))
    assert len(data.gain) <= data.num_values == count * frames
    for scale in (0.05, 1.0):
        assert data.information(scale) >= 0
        assert data.degrees(scale) >= 0


def test_a_slide_of_which_one_coordinate_was_measured_is_compared_with_its_own_noise(tmp_path):
    """A length along the slope, as x and y: what was never measured scatters in no replicate."""
    rng = np.random.default_rng(5)
    time_s = np.arange(90) / 120
    way = 0.5 * 9.81 * (np.sin(ANGLE) - 0.25 * np.cos(ANGLE)) * time_s**2
    way += SD_M * rng.standard_normal(len(time_s))
    rows = np.column_stack([time_s, *(ALONG[:, None] * way)])
    head = "time_s,object1_x_m,object1_y_m"
    np.savetxt(tmp_path / "slide.csv", rows, delimiter=",", header=head, comments="", fmt="%.8f")
    (tmp_path / "slide.yaml").write_text(YAML)
    compared = gx.compare(tmp_path / "slide.yaml")
    assert compared.p_value > 0.01
    assert compared.cells.noise.max() < 2 * SD_M * np.sqrt(2) * 120
