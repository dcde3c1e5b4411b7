"""What is in a hand at first: when a throw, a drop or a swing becomes free, and what stops it."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from galileo_jax.clip.load import load_clip
from galileo_jax.measurement.measure import measure
from galileo_jax.measurement.segments.handling import (
    goes_up,
    pushed_frame,
    thrown_frame,
)
from galileo_jax.measurement.segments.rest import standstill_frame
from galileo_jax.measurement.segments.segments import HELD, PLACED, PUSHED
from galileo_jax.measurement.segments.start_speed import let_go_frame
from galileo_jax.observation.observation import Observation
from tests.measurement.seen import seen

G = np.array([0.0, -9.81])


def noisy(times: np.ndarray, place: np.ndarray, noise_m: float) -> Observation:
    return seen(place, times, noise_m, seed=1)


def thrown(fps: float, hand_s: float, drag_per_m: float = 0.0, lasts_s: float = 0.9) -> tuple:
    """Speeded up evenly by a hand from rest to (2, 4) m/s; then gravity and the air."""
    start = np.array([2.0, 4.0])
    before = -np.arange(round(hand_s * fps), 0, -1) / fps
    times = np.arange(round(lasts_s * fps)) / fps

    def moves(_: float, state: np.ndarray) -> np.ndarray:
        velocity = state[2:]
        return np.append(velocity, G - drag_per_m * np.hypot(*velocity) * velocity)

    found = solve_ivp(moves, (0, lasts_s), [0, 0, *start], t_eval=times, rtol=1e-9)
    in_hand = np.outer(start, before)
    if hand_s:
        in_hand = in_hand + np.outer(start / hand_s, before**2 / 2)
    all_times = np.concatenate([before, times])
    return all_times - all_times[0], np.concatenate([in_hand, found.y[:2]], axis=1)


@pytest.mark.parametrize("fps", [25.0, 60.0, 240.0])
@pytest.mark.parametrize("drag_per_m", [0.0, 0.1])
def test_a_throw_begins_when_the_hand_is_off(fps: float, drag_per_m: float) -> None:
    times, place = thrown(fps, hand_s=0.16, drag_per_m=drag_per_m)
    first = thrown_frame(noisy(times, place, 5e-4), rest_belongs=False)
    assert first is not None
    # A hand's acceleration changes within so long, or within two frames and a half.
    assert abs(times[first] - 0.16) <= max(0.05, 2.5 / fps)


@pytest.mark.parametrize("noise_m", [3e-4, 5e-4, 8e-4])
def test_no_frame_of_the_hand_is_left(noise_m: float) -> None:
    """One that is would make gravity 1 % less."""
    times, place = thrown(60.0, hand_s=0.16)
    place = np.concatenate([np.repeat(place[:, :1], 12, axis=1), place], axis=1)
    times = np.concatenate([np.arange(-12, 0) / 60, times])
    first = thrown_frame(noisy(times, place, noise_m), rest_belongs=False)
    assert first is not None and 22 <= first <= 24


@pytest.mark.parametrize("drag_per_m", [0.0, 0.02, 0.15])
@pytest.mark.parametrize("noise_m", [1e-5, 3e-3])
def test_what_flies_from_the_first_frame_is_left_whole(drag_per_m: float, noise_m: float) -> None:
    times, place = thrown(60.0, hand_s=0.0, drag_per_m=drag_per_m)
    assert thrown_frame(noisy(times, place, noise_m), rest_belongs=False) is None


def dropped(lowered_m_s: float) -> tuple[np.ndarray, np.ndarray]:
    """Held still, or lowered steadily, for 0.3 s; then it falls."""
    times = np.arange(60) / 60
    free = np.maximum(times - 0.3, 0.0)
    height = 2 - lowered_m_s * times - 9.81 / 2 * free**2
    return times, np.stack([0 * height, height])


def test_a_drop_from_rest_has_no_hand_and_one_that_is_lowered_has() -> None:
    assert thrown_frame(noisy(*dropped(0.0), 5e-4), rest_belongs=True) is None
    times, place = dropped(0.4)
    first = thrown_frame(noisy(times, place, 5e-4), rest_belongs=True)
    assert first is not None and abs(times[first] - 0.3) <= 0.05
    # What lies still before it is thrown is no flight.
    assert thrown_frame(noisy(*dropped(0.0), 5e-4), rest_belongs=False) is not None


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


@pytest.mark.parametrize(
    ("held_s", "settles_s"), [(0.08, 0.16), (0.08, 0.5), (0.3, 0.1), (0.3, 0.16), (0.3, 0.5)]
)
def test_what_is_slowed_down_is_not_told_from_before_its_release(
    held_s: float, settles_s: float
) -> None:
    """A frame in which it still rests would be taken for one in which it goes back."""
    times, speed = np.arange(70) / 50, 0.84
    gone = speed * settles_s * np.log(np.cosh(np.clip(times - held_s, 0, None) / settles_s))
    for seed in range(8):
        frame = let_go_frame(seen(np.stack([0 * gone, -gone]), times, 5e-4, seed))
        assert frame is not None and held_s - 0.6 / 50 < times[frame] < held_s + 0.08


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


def test_a_push_shows_between_two_rests() -> None:
    """What rests is stated more exactly than it is marked: its scatter is no push."""
    times, slows_m_s2, at_s = np.arange(100) / 30, 3.0, (1.1, 1.36)
    push = np.clip(times - at_s[0], 0, at_s[1] - at_s[0])
    free = np.clip(times - at_s[1], 0, 1.9 / slows_m_s2)
    way = 1.9 / (at_s[1] - at_s[0]) * push**2 / 2 + 1.9 * free - slows_m_s2 * free**2 / 2
    rests = (times < at_s[0]) | (free == free.max())
    found = noisy(times, np.stack([way, 0 * way]), noise_m=2e-4)
    smaller = np.where(rests, 0.02, 1.0)
    found = replace(found, covariance_m2=found.covariance_m2 * smaller)
    first = pushed_frame(found)
    assert first is not None and at_s[1] < times[first] < at_s[1] + 0.2


def test_a_push_up_a_board_is_left_out() -> None:
    """It may last for a third of the way up; then it goes up, and back down, by itself."""
    times, off_s, push_m_s2, up, down = np.arange(70) / 30, 0.7, 7.0, 5.2, 1.5
    pushed = np.clip(times - 0.4, 0, off_s - 0.4)
    speed = push_m_s2 * (off_s - 0.4)
    rising = np.clip(times - off_s, 0, speed / up)
    falling = np.clip(times - off_s - speed / up, 0, None)
    gone = push_m_s2 * pushed**2 / 2 + speed * rising - up * rising**2 / 2 - down * falling**2 / 2
    way = np.stack([-gone, 0.36 * gone])
    found = noisy(times, way, noise_m=2e-4)
    first = pushed_frame(found)
    assert goes_up(found) and not goes_up(noisy(times, -way, noise_m=2e-4))
    assert first is not None and off_s - 1e-9 < times[first] < off_s + 0.2


@pytest.mark.parametrize("order", [(0, 1), (1, 0)])
def test_a_puck_that_is_pushed_is_free_before_it_hits_another(tmp_path, order) -> None:
    """From .3 to .55 s a hand speeds it up; at .8 s it strikes the other, which gains speed."""
    times, slows = np.arange(90) / 60, 2.0
    push, free = np.clip(times - 0.3, 0, 0.25), np.clip(times - 0.55, 0, 0.25)
    way = 5.2 * push**2 / 2 + 1.3 * free - slows * free**2 / 2
    after = np.clip(times - 0.8, 0, 0.2)
    struck = 0.8 * after - slows * after**2
    one = np.stack([way + 0.1 * after, 0 * way])
    other = np.stack([0.5 + struck, 0.02 + 0.5 * struck])
    place = np.stack([one, other])[list(order)]
    path = tmp_path / "pucks.yaml"
    path.write_text(
        "track: pucks.csv\nscenario: from_above\nobjects:\n"
        + "".join(f"- {{name: o{i}, shape: cylinder, size_m: [0.03, 0.02]}}\n" for i in (1, 2))
    )
    rows = noisy(times, place, 1e-4).position_m.reshape(4, -1)
    titles = "time_s,o1_x_m,o1_y_m,o2_x_m,o2_y_m"
    table = np.column_stack([times, *rows])
    np.savetxt(tmp_path / "pucks.csv", table, delimiter=",", header=titles, comments="")
    begin = next(cut for cut in measure(load_clip(path)).cuts if cut.side == "before")
    assert "pushed by a hand" in begin.why and 0.55 <= begin.time_s < 0.66
    assert begin.name == f"o{1 + order.index(0)}"


@pytest.mark.parametrize("hit_s", [0.3, 0.305, 0.31])
def test_what_a_wall_throws_back_past_its_start_was_not_pushed(hit_s: float) -> None:
    times, slows = np.arange(90) / 60, 0.3
    there, back = np.minimum(times, hit_s), np.clip(times - hit_s, 0, None)
    way = -1.0 * there + slows * there**2 / 2 + 0.8 * back - slows * back**2 / 2
    assert pushed_frame(noisy(times, np.stack([way, 0 * way]), noise_m=2e-4)) is None


def table_of(
    folder: Path, scenario: str, times: np.ndarray, place: np.ndarray, more="", noise_m=7e-4
) -> Path:
    """A table as others write them, and its yaml, which is returned."""
    noise = np.random.default_rng(5).normal(0, noise_m, place.shape)
    table = np.column_stack([times, *(place + noise)])
    np.savetxt(folder / "t.csv", table, "%.4f", ",", header="t (s),x (m),y (m)", comments="")
    path = folder / "t.yaml"
    path.write_text(
        f"track: t.csv\nscenario: {scenario}\n{more}objects:\n- {{name: thing, shape: sphere}}\n"
    )
    return path


def board_table(folder: Path, times: np.ndarray, gone: np.ndarray, angle_deg: int) -> Path:
    """The same of what has gone so far down a board."""
    angle = np.radians(angle_deg)
    place = np.stack([gone * np.cos(angle), 0.8 - gone * np.sin(angle)])
    return table_of(folder, "incline", times, place, f"ramp_angle_deg: {angle_deg}\n")


@pytest.mark.parametrize(
    ("rests_s", "hand_s", "gently"),
    [(0.0, 0.25, False), (0.0, 0.4, True), (0.6, 0.2, False), (0.3, 0.3, True)],
)
def test_of_a_throw_the_flight_is_kept_and_the_hand_left_out(
    tmp_path, rests_s, hand_s, gently
) -> None:
    """The hand lets go at once, or its push dies away; before, it may hold the thing still."""
    times, fine, velocity = np.arange(110) / 60, np.arange(0, 1.9, 1e-4), np.array([2.0, 3.0])
    share = np.clip((fine - rests_s) / hand_s, 0, 1)
    speed = (1 - np.cos(np.pi * share)) / 2 if gently else share
    flies = np.clip(fine - rests_s - hand_s, 0, None)
    moves = velocity[:, None] * speed - np.array([[0.0], [9.81]]) * flies
    place = np.stack([np.interp(times, fine, np.cumsum(one) * 1e-4) for one in moves])
    (cut,) = measure(load_clip(table_of(tmp_path, "flight", times, place, noise_m=2e-3))).cuts
    assert cut.side == "before" and cut.why == HELD
    # A push that dies away does not show to its end.
    assert (-0.05 if gently else -0.02) < cut.time_s - rests_s - hand_s < 0.1


@pytest.mark.parametrize("shakes_m", [0.0, 3e-3])
def test_a_ball_falls_from_a_hand_that_shakes_and_into_another(tmp_path, shakes_m) -> None:
    """A hand that is still is a rest, from which it is let go."""
    times, let_go_s, caught_s = np.arange(60) / 50, 0.4, 0.95
    falls = np.clip(times, let_go_s, caught_s) - let_go_s
    brakes = np.clip((times - caught_s) / 0.09, 0, 1)
    speed = 9.81 * (caught_s - let_go_s)
    y = -9.81 / 2 * falls**2 - speed * 0.09 * (brakes - brakes**2 / 2)
    y += shakes_m * np.sin(9 * times) * (times < let_go_s)
    place = np.stack([0 * y, 2 + y])
    cuts = measure(load_clip(table_of(tmp_path, "fall", times, place, noise_m=5e-4))).cuts
    assert [cut.side for cut in cuts] == ["before", "after"][shakes_m == 0 :]
    assert 0.92 <= cuts[-1].time_s <= 0.94, "no frame of the catch is left"
    if shakes_m:
        assert cuts[0].why == HELD and 0.4 < cuts[0].time_s < 0.5


def test_what_the_air_stops_from_falling_faster_was_not_held(tmp_path) -> None:
    """A paper cup, let go in the first row."""
    times, drag = np.arange(42) / 30, 3.8
    fallen = np.log(np.cosh(np.sqrt(9.81 * drag) * times)) / drag
    place = np.stack([0 * times, 2.5 - fallen])
    assert not measure(load_clip(table_of(tmp_path, "fall", times, place))).cuts


def test_who_lifts_a_ball_before_it_falls_is_left_out(tmp_path) -> None:
    times = np.arange(120) / 60
    lifted = 0.3 * np.clip(times / 0.5, 0, 1)
    falls = np.clip(times - 0.85, 0, np.sqrt(2 / 9.81))
    place = np.stack([0 * times, 1 + lifted - 9.81 / 2 * falls**2])
    before, after = measure(load_clip(table_of(tmp_path, "fall", times, place))).cuts
    assert before.why == PLACED and 0.5 < before.time_s < 0.85
    assert after.time_s == pytest.approx(0.85 + np.sqrt(2 / 9.81), abs=0.03)


def test_who_catches_a_throw_from_the_first_row_on_ends_it(tmp_path) -> None:
    """Speeded up by a hand, a flight of .7 s, and stopped within .08 s: no rest tells the usual."""
    times, place = thrown(60.0, 0.3, lasts_s=0.72)
    last, velocity = place[:, -1], (place[:, -1] - place[:, -2]) * 60
    since = np.arange(1, 16) / 60
    share = np.clip(since / 0.08, 0, 1)
    caught = last[:, None] + velocity[:, None] * 0.08 * (share - share**2 / 2)
    place = np.concatenate([place, caught], axis=1)
    times = np.concatenate([times, times[-1] + since])
    cuts = measure(load_clip(table_of(tmp_path, "flight", times, place, noise_m=1e-3))).cuts
    assert [cut.side for cut in cuts] == ["before", "after"]
    assert 0.28 < cuts[0].time_s < 0.4 and 0.95 < cuts[1].time_s < 1.03


def test_a_push_on_a_board_too_rough_to_slide_is_left_out(tmp_path) -> None:
    times, off_s, push, slows = np.arange(90) / 60, 0.2, 6.0, 1.6
    pushed, free = np.clip(times, 0, off_s), np.clip(times - off_s, 0, push * off_s / slows)
    gone = push * pushed**2 / 2 + push * off_s * free - slows * free**2 / 2
    path = board_table(tmp_path, times, gone, 12)
    (cut,) = measure(load_clip(path)).cuts
    assert (cut.side, cut.why) == ("before", PUSHED) and off_s < cut.time_s < off_s + 0.15


def test_what_a_brake_slows_on_its_way_was_not_pushed(tmp_path) -> None:
    """It gains speed for a third of the way, as the board lets it."""
    times, on_s, gains, slows = np.arange(90) / 60, 0.7, 1.5, 1.2
    fast, slow = np.clip(times, 0, on_s), np.clip(times - on_s, 0, gains * on_s / slows)
    gone = gains * fast**2 / 2 + gains * on_s * slow - slows * slow**2 / 2
    path = board_table(tmp_path, times, gone, 20)
    assert not [cut for cut in measure(load_clip(path)).cuts if cut.side == "before"]


@pytest.mark.parametrize("wobble_m", [0.0, 4e-3])
def test_who_carries_it_back_up_is_left_out_and_up_stays_up(tmp_path, wobble_m) -> None:
    """A hand that trembles lets go at .8 s, and catches it at 1.65 s."""
    times, off_s, caught_s, speeds_up = np.arange(200) / 60, 0.8, 1.65, 1.58
    free = np.clip(times - off_s, 0, caught_s - off_s)
    stopped = 0.04 * (1 - np.exp(-np.clip(times - caught_s, 0, None) / 0.04))
    gone = speeds_up * free**2 / 2 + speeds_up * (caught_s - off_s) * stopped
    gone = gone + wobble_m * np.sin(10.7 * times) * (times < off_s)
    gone = np.maximum(gone - 0.5 * np.clip(times - 2.0, 0, None), 0)
    path = board_table(tmp_path, times, gone, 23)
    measured = measure(load_clip(path))
    assert not any("track_y" in line or "direction" in line for line in measured.warnings)
    used = measured.segments.within(times)
    assert used[(times > 0.9) & (times < 1.6)].all() and not used[times > 1.7].any()
