"""A spring that is stiffer at its ends: Duffing's period, and a fit."""

import math

import numpy as np
import pytest
from scipy.special import ellipk

from galileo_jax.api.fit import fit
from galileo_jax.api.simulate import simulate
from galileo_jax.clip.track_csv import read_observation_csv
from galileo_jax.numerics.periodogram import period_s

REST = 0.1  # m, which it is let go from at rest: the amplitude
SWING = {"period": 1.0, "damping": 1e-9, "rest": REST, "start_speed": 0.0}


def clip(folder, stiffening: float, seconds: float, noise_m: float, damping: float):
    return simulate(
        folder / "clip.csv",
        scenario="spring",
        seed=3,
        fps=60.0,
        seconds=seconds,
        track_only=True,
        track_noise=noise_m,
        values=SWING | {"damping": damping},
        effects={"spring_stiffening": {"spring_stiffening": stiffening}},
    )


@pytest.mark.parametrize("stiffening", [30.0, -30.0])
def test_its_swing_takes_duffings_period(stiffening, tmp_path):
    """x = A cn(w sqrt(1 + c) t | m) from rest at A, c = b A^2, m = k^2 = c / (2 (1 + c))."""
    clip(tmp_path, stiffening, 5.0, 1e-6, 1e-9)
    own = read_observation_csv(tmp_path / "clip.csv")
    share = stiffening * REST**2
    expected = 4 * ellipk(share / (2 * (1 + share))) / (2 * math.pi * math.sqrt(1 + share))
    away = own.position_m[0, 1] - own.position_m[0, 1].mean()
    turns = np.flatnonzero((away[:-1] < 0) & (away[1:] >= 0))
    at = own.times_s[turns] - away[turns] * np.diff(own.times_s)[turns] / np.diff(away)[turns]
    assert np.diff(at).mean() == pytest.approx(expected, rel=1e-3)
    assert period_s(own.times_s, away) == pytest.approx(expected, rel=0.05)


def test_a_fit_tells_it_from_the_period(tmp_path):
    made = clip(tmp_path, 30.0, 3.0, 5e-4, 0.05)
    found = fit(made.clips[0], effects=["spring_stiffening"]).parameters
    for name, true in (("spring_stiffening", 30.0), ("period", 1.0), ("damping", 0.05)):
        assert abs(found[name]["mean"] - true) < 4 * found[name]["sd"], name
    assert found["spring_stiffening"]["sd"] < 3.0
