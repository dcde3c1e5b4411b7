"""A swing is cut from where it is let go to where something stops it; an undisturbed one is not."""

import numpy as np
import pytest

from galileo_jax.measurement.segments.handling import let_go_frame
from galileo_jax.measurement.segments.rest import standstill_frame
from galileo_jax.observation.observation import Observation
from tests.measurement.seen import seen

NOISE_M, AMPLITUDE_M = 3e-4, 0.06


def swing(
    fps: float,
    held_s: float = 0.0,
    stopped_s: float = np.inf,
    damping: float = 0.1,
    phase: float = 0.0,
    period_s: float = 0.9,
) -> Observation:
    """Up and down, from rest at `phase` 0."""
    times = np.arange(0.0, 4.0, 1 / fps)
    after = np.minimum(np.clip(times - held_s, 0.0, None), stopped_s - held_s)
    y = AMPLITUDE_M * np.exp(-damping * after) * np.cos(2 * np.pi * after / period_s + phase)
    return seen(np.stack([0.0 * y, y]), times, NOISE_M, seed=3)


@pytest.mark.parametrize("fps", [30.0, 60.0, 240.0])
@pytest.mark.parametrize("held_s", [0.15, 0.8, 2.0])
def test_the_release_is_found_however_late(fps: float, held_s: float) -> None:
    frame = let_go_frame(swing(fps, held_s))
    assert frame is not None
    assert -1.5 / fps < frame / fps - held_s < 3 / fps + 0.01


@pytest.mark.parametrize("fps", [30.0, 60.0, 240.0])
@pytest.mark.parametrize("phase", [0.0, 0.7, 1.6, 3.0])
@pytest.mark.parametrize("period_s", [0.4, 0.9, 2.0])
def test_what_swings_from_the_first_frame_on_is_not_held(
    fps: float, phase: float, period_s: float
) -> None:
    swings = swing(fps, phase=phase, period_s=period_s)
    assert let_go_frame(swings) is None
    assert standstill_frame(swings) is None


@pytest.mark.parametrize("fps", [30.0, 60.0, 240.0])
def test_who_stops_it_ends_it_and_damping_does_not(fps: float) -> None:
    stopped_s = 2.45  # on its way through the middle
    frame = standstill_frame(swing(fps, stopped_s=stopped_s))
    assert frame is not None
    assert -4 / fps - 0.01 < frame / fps - stopped_s <= 1e-9
    assert standstill_frame(swing(fps, damping=3.0)) is None
