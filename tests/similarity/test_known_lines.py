"""Places that are known along a line only: no mode counts what was not measured."""

from dataclasses import replace

import numpy as np

from galileo_jax.observation.observation import UNMEASURED_SD_M
from galileo_jax.similarity.gaussian_likelihood import (
    GaussianLikelihood,
    inverse_root_of,
    known_lines,
    whitening_of,
)
from tests.oracle_trials import observe
from tests.ramp_model import HIT

ANGLE = np.radians(31.0)


def along_a_line():
    """A track whose places are known along a slope, to a tenth of a millimetre."""
    seen = observe(HIT, 0)
    line = np.array([np.cos(ANGLE), -np.sin(ANGLE)])
    across = np.array([np.sin(ANGLE), np.cos(ANGLE)])
    cover = 1e-8 * np.outer(line, line) + 1.01 * UNMEASURED_SD_M**2 * np.outer(across, across)
    shape = seen.covariance_m2.shape
    return replace(seen, covariance_m2=np.broadcast_to(cover[None, ..., None], shape).copy()), line


def test_the_direction_is_that_of_the_line_in_stated_errors():
    seen, line = along_a_line()
    root = inverse_root_of(seen)
    is_line, along = known_lines(seen, root)
    assert is_line.all()
    white = np.einsum("oijt,j->oit", root, line) * 1e-4  # one sd along the line
    np.testing.assert_allclose(np.abs(np.sum(white * along, axis=1)), 1.0, rtol=1e-6)


def test_modes_take_up_no_more_than_was_measured():
    """With as many modes as coordinates noise is told by nothing, and never by less."""
    seen, _ = along_a_line()
    count, axes, frames = seen.position_m.shape
    every = 1e-2 * np.eye(count * axes * frames).reshape(-1, count, axes, frames)
    root = inverse_root_of(seen)
    data = whitening_of(seen, root, np.einsum("oijt,mojt->moit", root, every))
    assert len(data.gain) <= data.num_values == count * frames
    for scale in (0.05, 1.0):
        assert GaussianLikelihood.information(scale, data) >= 0
        assert GaussianLikelihood.degrees(scale, data) >= 0
