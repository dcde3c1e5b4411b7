"""Which formulas a missing force suggests, and which of them are fitted."""

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from galileo_jax.diagnosis.laws.grammar import FACTORS, Structure
from galileo_jax.diagnosis.laws.linearised_clip import LinearisedClip
from galileo_jax.diagnosis.laws.rank_formulas import (
    BEHIND,
    NUM_LAWS,
    NUM_SINGLE,
    Suggestion,
    chosen,
    suggestion_of,
)

FACTOR = {factor.label: factor for factor in FACTORS}
RANGES = {"t": (0.0, 1.0), "q": (-0.5, 0.5)}
TIMES = np.linspace(0.0, 1.0, 120)


def clip_that_lacks(
    missing_m_s2: np.ndarray, k: float = 0.2, per_m: float = 3000.0
) -> LinearisedClip:
    """One object on a table that lacks an acceleration; places are known to 1/`per_m`."""
    step = TIMES[1]
    places = np.tril(np.subtract.outer(TIMES, TIMES)) * step * per_m
    view: Any = SimpleNamespace(
        time_s=TIMES,
        path_m=(TIMES - 0.5)[None],
        speed_m_s=np.ones((1, len(TIMES))),
        moves=np.ones((1, len(TIMES)), bool),
        start_path_m=np.array([-0.5]),
        model=SimpleNamespace(
            scene=SimpleNamespace(surroundings=SimpleNamespace(gravity=9.81, angle_rad=0.0))
        ),
    )
    return LinearisedClip(view, places @ missing_m_s2, (places,), np.ones(1), np.array([k]))


def made(label: str, score: float, nature: Any = "push", is_on_all: bool = False) -> Suggestion:
    factors = tuple(FACTOR[each] for each in label.split("*"))
    return Suggestion(Structure(nature, is_on_all, factors), (), score)


def test_constants_between_the_points_of_the_grid_are_found():
    gust = 3.0 * np.exp(-(((TIMES - 0.407) / 0.057) ** 2))
    found = suggestion_of(
        [clip_that_lacks(gust)], Structure("push", False, (FACTOR["pulse_t"],)), RANGES
    )
    assert found is not None
    start = dict(found.starts[0])
    assert start.pop("c") == pytest.approx(3.0, rel=0.01)
    assert start == pytest.approx({"moment": 0.407, "width": 0.057}, abs=1e-3)


def test_starts_are_apart():
    found = suggestion_of(
        [clip_that_lacks(TIMES**2)], Structure("push", False, (FACTOR["power_t"],)), RANGES
    )
    assert found is not None
    powers = [start["p"] for start in found.starts]
    assert powers[0] == pytest.approx(2.0, abs=0.02)
    assert min(abs(a - b) for i, a in enumerate(powers) for b in powers[:i]) > 0.4


def test_a_wave_starts_at_several_lengths():
    """And not at one length with opposite phases, which is one formula twice."""
    wave = np.sin(6.283 * (TIMES - 0.5) / 0.2 + 1.0) + 0.8 * np.sin(6.283 * (TIMES - 0.5) / 0.29)
    found = suggestion_of(
        [clip_that_lacks(wave)], Structure("push", False, (FACTOR["wave_q"],)), RANGES
    )
    assert found is not None
    lengths = [start["length"] for start in found.starts]
    assert min(abs(length - 0.2) for length in lengths) < 0.02
    assert min(abs(length - 0.29) for length in lengths) < 0.02
    assert min(abs(a / b - 1) for i, a in enumerate(lengths) for b in lengths[:i]) > 0.05


@pytest.mark.parametrize(("k", "change"), [(0.5, -0.612), (0.1, -0.25)])
def test_no_friction_becomes_negative(k, change):
    push = 6.0 * np.exp(-(((TIMES - 0.4) / 0.06) ** 2))
    structure = Structure("friction", False, (FACTOR["pulse_t"],))
    found = suggestion_of([clip_that_lacks(push, k)], structure, RANGES)
    assert found is not None
    assert found.starts[0]["c"] == pytest.approx(change, abs=0.02)


@pytest.mark.parametrize(("forward_m_s2", "is_drag"), [(-2.0, True), (2.0, False)])
def test_what_drives_is_no_drag(forward_m_s2, is_drag):
    """A drag takes energy; a push may have either sign."""
    seen = [clip_that_lacks(forward_m_s2 * np.exp(-TIMES / 0.3))]
    pair = (FACTOR["decay_t"], FACTOR["power_v"])
    drag = suggestion_of(seen, Structure("drag", False, pair), RANGES)
    push = suggestion_of(seen, Structure("push", False, pair[:1]), RANGES)
    assert drag is not None and push is not None and push.score > 100.0
    assert (drag.score > 100.0) == is_drag


def test_two_factors_leave_room_for_one():
    pairs = ["power_t*pulse_q", "decay_t*pulse_q", "pulse_q*power_v", "power_t*linear_q"]
    pairs += ["decay_t*linear_q", "power_t*growth_q", "decay_t*growth_q", "power_t*power_v"]
    single = ["pulse_t", "wave_t", "step_t", "linear_q", "decay_t"]
    found = [made(pair, 100.0 - i) for i, pair in enumerate(pairs)]
    found += [made(one, 80.0 - i) for i, one in enumerate(single)]
    labels = [one.structure.family for one in chosen(found)]
    assert len(labels) == NUM_LAWS
    assert sum("*" not in label for label in labels) == NUM_SINGLE
    assert "decay_t" not in labels


def test_what_does_not_differ_here_is_fitted_once():
    found = [made("pulse_t", 50.0), made("pulse_t", 50.0, is_on_all=True)]
    found += [made("pulse_t", 49.0, "friction"), made("far_q", 48.0), made("pulse_q", 47.0)]
    natures = [(one.structure.nature, one.structure.family) for one in chosen(found)]
    assert natures == [
        ("push", "pulse_t"),
        ("friction", "pulse_t"),
        ("push", "pulse_q"),
        ("push", "pulse_q"),
    ]


@pytest.mark.parametrize(
    ("best", "behind", "is_fitted"), [(60.0, 50.0, False), (3000.0, 200.0, True)]
)
def test_how_far_behind_goes_with_what_is_to_be_explained(best, behind, is_fitted):
    """A linear model of a large change is as wrong."""
    assert behind > BEHIND
    found = chosen([made("pulse_t", best), made("pulse_q", best - behind)])
    assert (len(found) == 2) == is_fitted


def test_the_family_of_a_form_that_fits_has_a_place():
    found = [made(label, 90.0) for label in ("pulse_t", "wave_t", "step_t", "decay_t")]
    found += [made("power_t", 20.0, "friction"), made("power_t", 10.0)]
    assert "power_t" not in [one.structure.family for one in chosen(found)]
    kept = [
        one
        for one in chosen(found, [("power_t", "friction", True)])
        if one.structure.family == "power_t"
    ]
    assert [one.structure.nature for one in kept] == ["friction"]


def test_the_nature_of_a_form_that_fits_has_a_place():
    """A push of the same family may explain more in a linear model, of friction that doubles."""
    found = [made(label, 90.0) for label in ("pulse_t", "wave_t", "step_t", "decay_t")]
    found += [made("power_t", 80.0), made("power_t", 20.0, "friction")]
    found.append(made("power_t", 10.0, "friction", is_on_all=True))
    kept = [one for one in chosen(found, [("power_t", "friction", True)]) if is_power(one)]
    natures = [(one.structure.nature, one.structure.is_on_all) for one in kept]
    assert ("friction", True) in natures and ("friction", False) not in natures
    assert {one.structure.nature for one in chosen(found) if is_power(one)} == {"push"}


def is_power(one: Suggestion) -> bool:
    return one.structure.family == "power_t"
