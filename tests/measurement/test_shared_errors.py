"""A run that is read again has the errors with which it was fitted."""

from dataclasses import replace

import numpy as np

from galileo_jax.measurement.shared_errors import ERRORS, with_errors, write_errors
from tests.oracle_trials import observe
from tests.ramp_model import HIT


def test_modes_and_where_the_track_is_from_come_back(tmp_path):
    plain = observe(HIT, 0)
    modes = np.random.default_rng(0).standard_normal((3, *plain.position_m.shape))
    seen = replace(plain, modes_m=modes, num_errors=2, is_squared=True, noise_known_to=0.15)
    write_errors(tmp_path / ERRORS, seen)
    found = with_errors(tmp_path / ERRORS, plain)
    assert found.modes_m is not None and (found.modes_m == modes).all()
    assert (found.num_errors, found.is_squared, found.noise_known_to) == (2, True, 0.15)


def test_how_far_pucks_turned_comes_back(tmp_path):
    plain = observe(HIT, 0)
    turned = np.where(plain.mask, 0.1, np.nan)
    write_errors(tmp_path / ERRORS, replace(plain, turned_rad=turned))
    np.testing.assert_array_equal(with_errors(tmp_path / ERRORS, plain).turned_rad, turned)


def test_a_run_of_an_earlier_version_is_read(tmp_path):
    plain = observe(HIT, 0)
    write_errors(tmp_path / ERRORS, replace(plain, is_squared=True))
    with np.load(tmp_path / ERRORS) as file:
        older = {name: file[name] for name in file.files if name != "noise_known_to"}
    np.savez_compressed(tmp_path / ERRORS, **older)
    assert with_errors(tmp_path / ERRORS, plain).noise_known_to == 0.0


def test_a_track_without_any_leaves_no_file(tmp_path):
    plain = observe(HIT, 0)
    write_errors(tmp_path / ERRORS, replace(plain, is_squared=True))
    assert (tmp_path / ERRORS).is_file()
    write_errors(tmp_path / ERRORS, plain)
    assert not (tmp_path / ERRORS).exists()
    assert with_errors(tmp_path / ERRORS, plain) is plain
