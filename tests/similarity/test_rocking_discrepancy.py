"""A box that rocks on an edge past the foot: what lifts it is found, and is no misfit."""

from dataclasses import replace

import numpy as np
import pytest

from galileo_jax.observation.observation import Observation
from galileo_jax.similarity.discrepancy import crossings, modes
from galileo_jax.similarity.gaussian_likelihood import whitening_in
from galileo_jax.similarity.rocking_discrepancy import rocking
from tests.oracle_trials import observe
from tests.ramp_model import HIT, make_surroundings

TALL = replace(HIT, size_m=((0.05, 0.08), (0.06, 0.06)))
SCENE = make_surroundings(TALL)
RISE_M = 4e-3


def level(seed: int = 0) -> Observation:
    """It slides through the foot and hits object 2."""
    return observe(TALL, seed)


def past(seen: Observation) -> np.ndarray:
    """`[frame]`, where object 1 is wholly past the foot."""
    return seen.position_m[0, 0] > 0.05


def lifted(seen: Observation, first: int, rise_m: np.ndarray) -> Observation:
    """Object 1 lifted in frames from `first` past the foot on, and ahead by as much as it turns."""
    place = seen.position_m.copy()
    begin = int(np.argmax(past(seen))) + first
    frames = slice(begin, begin + len(rise_m))
    place[0, 1, frames] += rise_m
    place[0, 0, frames] += 0.08 / 0.05 * rise_m
    return replace(seen, position_m=place)


def rocks(seen: Observation) -> list[tuple[slice, float]]:
    return rocking(seen.position_m, seen, SCENE, 0, past(seen))


BUMP = RISE_M * np.array([0.7, 1.0, 0.6])


@pytest.mark.parametrize("first", [0, 2])
def test_it_is_found_with_its_rise(first):
    seen = lifted(level(), first, BUMP)
    ((frames, rise),) = rocks(seen)
    begin = int(np.argmax(past(seen))) + first
    assert (frames.start, frames.stop) == (begin, begin + 3)
    assert rise == pytest.approx(RISE_M, abs=6e-4)


@pytest.mark.parametrize("slope", [0.0, 0.03, -0.03], ids=["level", "rises", "falls"])
def test_a_table_that_slopes_lifts_nothing(slope):
    for seed in range(5):
        seen = level(seed)
        seen.position_m[:, 1] += np.where(
            seen.position_m[:, 0] > 0, slope * seen.position_m[:, 0], 0
        )
        assert rocks(seen) == []
        ((_, rise),) = rocks(lifted(seen, 1, BUMP))
        assert rise == pytest.approx(RISE_M, abs=1e-3)


def test_what_stays_up_does_not_rock():
    seen = level()
    assert rocks(lifted(seen, 3, np.full(15, RISE_M))) == []


def misfit(seen: Observation) -> float:
    """chi2 per value of the whole track against the closed form."""
    data = whitening_in(seen, SCENE, noise="bodies")
    difference = (
        np.where(seen.mask[:, None], seen.position_m, 0.0) - observe(TALL, 0, 0.0).position_m
    )
    white = data.whiten_batch(difference, 1.0)
    return float(np.sum(white**2)) / seen.position_m.size


def test_it_is_no_misfit_and_leaves_a_step(monkeypatch):
    """Nor is it where the box goes on from, if that is within what turning takes it ahead."""
    seen = lifted(level(), 1, BUMP)
    later = int(np.argmax(past(seen))) + 4
    seen.position_m[0, 0, later:] += 4e-3
    assert misfit(seen) < 1.2
    one, whole = crossings(seen, SCENE), modes(seen, SCENE)
    monkeypatch.setattr("galileo_jax.similarity.rocking_discrepancy.RISES_M", 1.0)
    assert misfit(seen) > 3
    assert len(one) - len(crossings(seen, SCENE)) == 2 * 3, "either axis of three frames"
    assert len(whole) - len(modes(seen, SCENE)) == 1
