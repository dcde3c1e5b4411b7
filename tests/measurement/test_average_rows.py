"""Long tracks: means of rows, with the errors of means, where rows are of a smooth path."""

from dataclasses import replace

import numpy as np
import pytest

from galileo_jax.measurement.average_rows import MOST_ROWS, with_rows_averaged
from galileo_jax.observation.observation import UNMEASURED_SD_M, Observation
from tests.measurement.seen import seen

SD_M = 5e-4


def went(way_m: np.ndarray, times_s: np.ndarray) -> Observation:
    return seen(np.stack([way_m, -0.3 * way_m]), times_s, SD_M, seed=0)


def swing(times_s: np.ndarray) -> np.ndarray:
    return 0.1 * np.sin(2 * np.pi * times_s / 1.5)


@pytest.mark.parametrize("count", [1100, 1600, 2000])
def test_means_are_right_within_their_errors(count):
    """Also where the path bends: a swing of 10 cm has 90 rows in its period."""
    times = np.arange(count) / 60
    averaged, said = with_rows_averaged(went(swing(times), times))
    assert len(averaged.times_s) < 1.2 * MOST_ROWS
    sd = np.sqrt(averaged.covariance_m2[0, 0, 0])
    assert np.median(sd) < 0.8 * SD_M
    error = (averaged.position_m[0, 0] - swing(averaged.times_s)) / sd
    assert np.mean(error**2) == pytest.approx(1.0, abs=0.2)
    assert f"{count} rows are averaged" in said[0]


def test_nothing_is_lost():
    """What the rows tell of a straight line the means tell as well, within a tenth."""
    times = np.arange(2000) / 60
    whole = went(0.3 * times, times)
    averaged, _ = with_rows_averaged(whole)

    def slope_sd(one: Observation) -> float:
        design = np.vander(one.times_s, 2) / np.sqrt(one.covariance_m2[0, 0, 0])[:, None]
        return float(np.sqrt(np.linalg.inv(design.T @ design)[0, 0]))

    assert slope_sd(averaged) == pytest.approx(slope_sd(whole), rel=0.2)
    assert slope_sd(averaged) >= 0.99 * slope_sd(whole), "means tell no more than their rows"


def test_the_first_seen_row_stays_at_its_time():
    """A start is inferred for it: half a group later a pendulum goes at another speed."""
    times = np.arange(1600) / 60
    observation = went(swing(times), times)
    mask = observation.mask.copy()
    mask[0, :7] = False
    averaged, _ = with_rows_averaged(replace(observation, mask=mask))
    first = int(averaged.mask[0].argmax())
    assert averaged.times_s[first] == times[7]
    assert averaged.position_m[0, 0, first] == observation.position_m[0, 0, 7]


def test_rows_at_a_blow_and_a_gap_stay_as_they_are():
    times = np.arange(1600) / 400
    way = 5 * np.abs(times - 2.0)  # 5 m/s, and back
    observation = went(way, times)
    mask = observation.mask.copy()
    mask[0, 300:303] = False
    averaged, _ = with_rows_averaged(replace(observation, mask=mask))
    near = np.abs(averaged.times_s - 2.0) < 2.5 / 400
    assert near.sum() == 5
    assert np.allclose(averaged.covariance_m2[0, 0, 0, near], SD_M**2)
    kept = averaged.mask[0]
    sd = np.sqrt(averaged.covariance_m2[0, 0, 0, kept])
    error = (averaged.position_m[0, 0, kept] - 5 * np.abs(averaged.times_s[kept] - 2.0)) / sd
    assert np.mean(error**2) == pytest.approx(1.0, abs=0.2)
    assert not ((averaged.times_s > 299.5 / 400) & (averaged.times_s < 302.5 / 400) & kept).any()


def test_what_is_known_along_a_line_stays_known_along_it_alone():
    """And a blow is seen along it: what was not measured makes no row smoother than it is."""
    times = np.arange(1600) / 400
    along, across = np.array([0.6, -0.8]), np.array([0.8, 0.6])
    way = 5 * np.abs(times - 2.0) + SD_M * np.random.default_rng(0).standard_normal(1600)
    error = SD_M**2 * np.outer(along, along) + UNMEASURED_SD_M**2 * np.outer(across, across)
    whole = replace(
        went(way, times),
        position_m=np.einsum("a,t->at", along, way)[None],
        covariance_m2=np.broadcast_to(error[None, :, :, None], (1, 2, 2, 1600)),
    )
    averaged, _ = with_rows_averaged(whole)
    assert len(averaged.times_s) < 1.2 * MOST_ROWS
    found = np.abs(np.einsum("a,oat->ot", across, averaged.across))
    np.testing.assert_allclose(found, 1.0)
    sd = np.sqrt(np.einsum("a,oabt,b->ot", along, averaged.covariance_m2, along)[0])
    assert np.median(sd) < 0.8 * SD_M
    assert (np.abs(averaged.times_s - 2.0) < 2.5 / 400).sum() == 5


def test_shared_errors_are_averaged_alike():
    times = np.arange(1200) / 60
    drift = np.zeros((1, 1, 2, 1200))
    drift[0, 0, 0] = times / times[-1]
    averaged, _ = with_rows_averaged(replace(went(swing(times), times), modes_m=drift))
    assert averaged.modes_m is not None
    assert averaged.modes_m[0, 0, 0] == pytest.approx(averaged.times_s / times[-1])


def test_scatter_that_is_a_shared_error_keeps_no_row_from_its_mean():
    """As in a film at rest, whose frames are known far better than what they share wanders."""
    rng, times = np.random.default_rng(0), np.arange(1000) / 120
    wander = 20 * SD_M * rng.standard_normal(1000)
    modes = np.zeros((1000, 1, 2, 1000))
    modes[np.arange(1000), 0, 0, np.arange(1000)] = 20 * SD_M
    whole = went(0.3 * times, times)
    shaken = replace(whole, position_m=whole.position_m + wander * np.array([[1.0], [0.0]]))
    assert len(with_rows_averaged(shaken)[0].times_s) > 900
    averaged, _ = with_rows_averaged(replace(shaken, modes_m=modes))
    assert len(averaged.times_s) < 1.2 * MOST_ROWS
    assert averaged.modes_m is not None
    shared = np.einsum("mt,mt->t", averaged.modes_m[:, 0, 0], averaged.modes_m[:, 0, 0])
    error = averaged.position_m[0, 0] - 0.3 * averaged.times_s
    assert np.mean(error**2 / (shared + averaged.covariance_m2[0, 0, 0])) == pytest.approx(
        1, abs=0.2
    )


def test_two_objects_of_a_film_have_half_the_rows_of_one():
    times = np.arange(MOST_ROWS) / 120
    one = went(0.3 * times, times)
    both = replace(
        one,
        names=("object1", "object2"),
        position_m=np.concatenate([one.position_m, one.position_m]),
        covariance_m2=np.concatenate([one.covariance_m2, one.covariance_m2]),
        mask=np.concatenate([one.mask, one.mask]),
    )
    assert with_rows_averaged(both) == (both, []), "of a table rows count"
    both = replace(both, noise_known_to=0.1)
    assert len(with_rows_averaged(both)[0].times_s) < 0.6 * MOST_ROWS


def test_a_short_track_stays_as_it_is():
    times = np.arange(MOST_ROWS) / 60
    observation = went(swing(times), times)
    assert with_rows_averaged(observation) == (observation, [])


def test_an_error_that_nobody_knows_of_a_row_that_was_not_seen_stays_there():
    times = np.arange(1600) / 60
    mask = np.ones((1, 1600), bool)
    mask[0, [0, 800]] = False
    whole = went(swing(times), times)
    position = np.where(mask[:, None], whole.position_m, np.nan)
    covariance = np.where(mask[:, None, None], whole.covariance_m2, np.nan)
    gappy = replace(whole, position_m=position, covariance_m2=covariance, mask=mask)
    averaged, _ = with_rows_averaged(gappy)
    assert len(averaged.times_s) < 1.2 * MOST_ROWS
    is_known = np.isfinite(averaged.covariance_m2).all(axis=(1, 2))
    assert (is_known == averaged.mask).all()
    assert (np.isfinite(averaged.position_m).all(axis=1) == averaged.mask).all()
