import numpy as np
import pytest

from galileo_jax.video.stamps import at_declared_rate, clock_of, is_blank, listed, repeats


@pytest.mark.parametrize("fps", [15.1515, 29.97, 240.0])
@pytest.mark.parametrize("tick_s", [1 / 1000, 1 / 600])
def test_rounded_stamps_are_an_even_grid(fps: float, tick_s: float) -> None:
    exact_s = np.arange(300) / fps
    clock = clock_of(3.0 + np.round(exact_s / tick_s) * tick_s, tick_s)
    assert clock.is_even
    assert clock.rate == pytest.approx(fps, rel=1e-4)
    np.testing.assert_allclose(clock.times_s, exact_s, atol=tick_s / 5)


@pytest.mark.parametrize("lost", [[1], [30, 31, 150], [298]])
def test_lost_pictures_leave_gaps_in_the_grid(lost: list[int]) -> None:
    number = np.delete(np.arange(300), lost)
    clock, _ = at_declared_rate(clock_of(number / 60, 1 / 15360), 60.0)
    np.testing.assert_allclose(clock.times_s, number / 60, atol=1e-12)


def test_a_phones_stamps_are_taken_as_they_are() -> None:
    steps = np.random.default_rng(0).uniform(0.030, 0.040, 100)
    stamps_s = np.concatenate([[0.0], np.cumsum(steps)])
    clock = clock_of(0.2 + stamps_s, 1 / 90_000)
    assert not clock.is_even
    for declared in (clock.rate, 1.01 * clock.rate):  # confirms it
        np.testing.assert_allclose(at_declared_rate(clock, declared)[0].times_s, stamps_s)
    slow, rate = at_declared_rate(clock, 8 * clock.rate)
    assert rate == pytest.approx(clock.rate, rel=0.02)
    np.testing.assert_allclose(slow.times_s, stamps_s / 8, rtol=0.02)


def test_a_declared_rate_rescales_the_clock() -> None:
    clock, rate = at_declared_rate(clock_of(np.arange(50) * 1001 / 30_000, 1e-5), 240.0)
    assert rate == pytest.approx(29.97, rel=1e-4)
    np.testing.assert_allclose(clock.times_s, np.arange(50) / 240, atol=1e-9)


def changes(*numbers: float) -> np.ndarray:
    return np.array([np.inf, *numbers])


def test_repeats_of_pictures() -> None:
    threes = changes(*[0.5] * 8, *[90, 1.5, 1] * 6, 0.5, 0.5)
    assert np.flatnonzero(~repeats(threes)).tolist() == [0, 3, 6, *range(9, 27, 3), 27]
    # 24 pictures a second as 30: one in five repeats.
    fifths = changes(*[60, 65, 1, 70, 70] * 4)
    assert np.flatnonzero(repeats(fifths)).tolist() == [3, 8, 13, 18]
    # A camera that froze, for two pictures and for one.
    frozen = changes(*[1.0] * 8, 60, 64, 66, 70, 1, 2, 200, 75, 78, 80, 82, 0.5, 170, 88, 90, 92)
    assert np.flatnonzero(repeats(frozen)).tolist() == [13, 14, 20]
    # A slow beginning, a turn of a swing, a rest: nothing repeats.
    assert not repeats(changes(*np.linspace(0.1, 90, 40))).any()
    for turn in (np.linspace(-80, 80, 41), np.linspace(-80, 80, 17)):
        assert not repeats(changes(*np.abs(turn))).any()
    assert not repeats(changes(*[80.0] * 10, *[0.5] * 30, *[80.0] * 10)).any()
    assert not repeats(changes(*[2.0, 0.1] * 20)).any()  # noise


@pytest.mark.parametrize(
    ("beside", "is_repeat"), [((62.0, 41.0), False), ((88.0, 84.0), True), ((41.0, 62.0), True)]
)
def test_a_turn_is_no_repeat(beside: tuple[float, float], is_repeat: bool) -> None:
    """A pendulum turns within one step: a picture like the one before, and less and less before."""
    steady = np.full(20, 95.0)
    change = np.concatenate([steady, beside, [3.0], beside[::-1], steady])
    assert repeats(change).any() == is_repeat


def test_pale_ends() -> None:
    contrast = np.array([0, 3, 9, 10, 2, *[10.0] * 5, 4, 1])
    assert np.flatnonzero(is_blank(contrast)).tolist() == [0, 1, 10, 11]


@pytest.mark.parametrize("shape", [lambda s: s, lambda s: (1 - np.cos(np.pi * s)) / 2, np.sqrt])
@pytest.mark.parametrize("num_black", [1, 6])
def test_a_fade_lasts_until_the_contrast_rises_no_more(shape, num_black):
    fade = 19 * shape(np.arange(1, 13) / 12)
    noise = 0.05 * np.random.default_rng(num_black).standard_normal(50)
    contrast = np.concatenate([np.full(num_black, 0.4), fade, 19 + noise])
    found = np.flatnonzero(~is_blank(contrast))
    assert contrast[found].min() > 0.97 * 19 and len(found) >= 50
    np.testing.assert_array_equal(is_blank(contrast[::-1]), is_blank(contrast)[::-1])


def test_a_film_that_begins_at_once_after_black_loses_no_picture():
    """Though something comes into it, which raises the contrast step by step."""
    contrast = np.concatenate([np.full(5, 0.4), 19 + 0.5 * np.arange(20)])
    assert np.flatnonzero(is_blank(contrast)).tolist() == [0, 1, 2, 3, 4]


def test_numbers_in_a_line() -> None:
    assert listed(np.array([3])) == "3"
    assert listed(np.arange(3, 10)) == "3 to 9"
    assert listed(np.array([1, 2, 4])) == "1, 2, 4"
    assert listed(np.arange(0, 40, 2)) == "0, 2, 4, 6, 8, 10, 12, 14, ..."
