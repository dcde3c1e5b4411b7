"""Where a run ends: at what stops an object within a step, and not at what brakes it."""

from pathlib import Path

import numpy as np
import pytest

from galileo_jax.assembly.build_problem import make_problem
from galileo_jax.clip.load import load_clip
from galileo_jax.measurement.measure import inferred, measure
from galileo_jax.measurement.segments.blow import arrest_frame, blow_frame
from galileo_jax.measurement.segments.handling import hand_frame
from galileo_jax.measurement.segments.segments import HELD, STOPPED, STRUCK, Segments, segment
from galileo_jax.observation.observation import Observation
from tests.measurement.seen import seen

NOISE_M = 1e-4
DOWN = np.array([np.cos(0.4), -np.sin(0.4)])


def slid(speed_m_s: np.ndarray, fps: float, seed: int = 0) -> Observation:
    """An object that goes `speed_m_s` `[step]` down a board."""
    way = np.concatenate([[0.0], np.cumsum(speed_m_s) / fps])
    return seen(way * DOWN[:, None], np.arange(len(way)) / fps, NOISE_M, seed)


@pytest.mark.parametrize("fps", [30.0, 60.0, 240.0])
@pytest.mark.parametrize("rebound", [0.0, -0.3, 0.1])
def test_a_stop_ends_the_run(fps, rebound):
    before = 1.2 * np.arange(1, int(fps)) / fps
    after = np.full(4, rebound * before[-1])
    assert arrest_frame(slid(np.append(before, after), fps)) == len(before)


def test_a_smeared_step_goes_too():
    before = 1.2 * np.arange(1, 240) / 240
    hit = np.array([0.8, 0.4, 0.1, 0.1]) * before[-1]
    assert arrest_frame(slid(np.append(before, hit), 240.0)) == len(before)


@pytest.mark.parametrize("fps", [30.0, 60.0])
@pytest.mark.parametrize(
    "brake_per_s", [2.0, 5.0, 10.0], ids=["weak brake", "brake", "strong brake"]
)
def test_what_brakes_is_no_stop(brake_per_s, fps):
    """A zone in which a drag begins at once, whatever comes after; and friction to a rest."""
    fast = np.minimum(1.2 * np.arange(1, int(fps)) / fps, 1.0)
    slow = fast[-1] * np.exp(-brake_per_s * np.arange(1, int(fps)) / fps)
    assert arrest_frame(slid(np.append(fast, slow), fps)) is None
    rest = np.clip(1.0 - 9.81 * np.arange(1, int(fps)) / fps, 0.0, None)
    assert arrest_frame(slid(np.append(fast, rest), fps)) is None


STOPS = np.append(1.2 * np.arange(1, 60) / 60, np.zeros(5))


def write_clip(folder: Path, scenario: str, more: str = "", speed_m_s=STOPS) -> Path:
    """A run, with a stop at its end if nothing else is said: its csv and yaml; returns the yaml."""
    run = slid(speed_m_s, 60.0)
    rows = [
        f"{t},{x},{y},{NOISE_M}" for t, x, y in zip(run.times_s, *run.position_m[0], strict=True)
    ]
    head = "time_s,object1_x_m,object1_y_m,object1_sd_m"
    (folder / "run.csv").write_text("\n".join([head, *rows]) + "\n")
    path = folder / "run.yaml"
    path.write_text(
        f"track: run.csv\nscenario: {scenario}\n{more}objects:\n"
        "  - {name: object1, shape: sphere, size_m: [0.03]}\n"
    )
    return path


def test_what_follows_is_left_out_and_it_is_said(tmp_path):
    measured = measure(load_clip(write_clip(tmp_path, "fall")))
    mask = measured.observation.mask[0]
    assert len(mask) == 60 and mask.all(), "frames that are left out at the end cost no time"
    assert measured.observation.times_s[-1] == pytest.approx(59 / 60)
    (remark,) = measured.remarks
    assert (
        "object1 is stopped by something that is not in the scene; everything after 0.983 s"
        in remark
    )
    (entry,) = inferred([measured])["cuts"]["run"]
    assert entry == {"name": "object1", "time_s": 59 / 60, "side": "after", "why": STOPPED}
    assert measured.whole.mask[0, 60:].any(), "the whole track is still there"


def test_a_declared_floor_is_in_the_scene(tmp_path):
    """What bounces on it is not cut off."""
    clip = load_clip(write_clip(tmp_path, "fall", "floor: true\n"))
    run = slid(STOPS, 60.0)
    assert segment(clip, run) == Segments()
    bare = clip.model_copy(update={"floor": False})
    (stop,) = segment(bare, run).cuts
    assert stop.time_s == pytest.approx(59 / 60)


@pytest.mark.parametrize(
    ("fps", "kept"), [(30.0, -0.5), (60.0, -0.2), (60.0, 0.5), (240.0, -0.4), (240.0, 0.65)]
)
def test_a_blow_ends_the_run(fps, kept):
    """The block bounces off the end stop, or passes it with less speed, and slides on."""
    rest, way = np.zeros(int(0.4 * fps)), 1.2 * np.arange(1, int(1.06 * fps)) / fps
    on = kept * way[-1] + 1.2 * np.arange(1, int(0.5 * fps)) / fps
    run = slid(np.concatenate([rest, way, on]), fps)
    assert blow_frame(run) == len(rest) + len(way)
    assert hand_frame(run) is None


@pytest.mark.parametrize("seed", range(6))
def test_a_bounce_between_two_frames_ends_the_flight_before_it(seed):
    """In space, with times uncertain by 0.4 ms: errors along the way are far larger than across."""
    rng = np.random.default_rng(seed)
    times = np.arange(60) / 145
    hit_s = times[22] + rng.uniform(0.25, 0.75) / 145
    read_s = times + 4e-4 * rng.standard_normal(60)
    since = np.maximum(read_s - hit_s, 0)
    height = 2.2 * (hit_s - read_s) + 4.0 * since - 4.9 * (read_s - hit_s) ** 2
    place = np.stack([0.4 * read_s, height, 8.0 * read_s - 1.5 * since])
    place = place + 7e-4 * rng.standard_normal(place.shape)
    assert blow_frame(seen(place, times, 2e-3)) == 22


@pytest.mark.parametrize("seed", range(6))
def test_a_blow_stands_out_from_weight(seed: int) -> None:
    """Three times what weight changes in five frames: without weight it is all there is."""
    rng = np.random.default_rng(seed)
    times, hit_s = np.arange(44) / 60, 0.4
    late, turn = np.maximum(times - hit_s, 0.0), rng.uniform(0, 2 * np.pi)
    place = np.stack([1.6 * times, 3.3 * times - 4.905 * times**2])
    place += 2.5 * np.outer([np.cos(turn), np.sin(turn)], late)
    found = blow_frame(seen(place + rng.normal(0, 1e-3, place.shape), times, 1e-3))
    assert found is not None and abs(found - 24) <= 1


@pytest.mark.parametrize(
    ("fps", "settles_s"), [(30.0, 0.33), (60.0, 0.4), (120.0, 0.2), (240.0, 0.1)]
)
def test_what_soon_goes_steadily_is_not_struck(fps, settles_s):
    """A ball that sinks, and a puck whose drag ends: most of the way is without acceleration."""
    times = np.arange(1, int(2.0 * fps)) / fps
    sinks = 9.81 * settles_s * np.tanh(times / settles_s)
    slows = 0.05 + 3.0 / (1 + times / settles_s)
    assert blow_frame(slid(sinks, fps)) is None
    assert blow_frame(slid(slows, fps)) is None


def test_weight_turns_a_throw_down_while_it_is_out_of_sight():
    times = np.delete(np.arange(50) / 50, slice(14, 23))
    place = np.stack([1.8 * times, 1 + 3.4 * times - 4.905 * times**2])
    thrown = seen(place, times, 1e-3)
    assert arrest_frame(thrown) is None and blow_frame(thrown) is None


def test_one_bad_point_is_no_blow():
    way = 1.2 * np.arange(1, 240) / 240
    run = slid(way, 240.0)
    run.position_m[0, :, 150] += 0.02
    assert blow_frame(run) is None


@pytest.mark.parametrize("finger", [0.2, 3.0], ids=["holds it back", "pushes it"])
def test_the_hand_is_found(finger):
    """From rest, very late; for 0.2 s with a finger at it, which leaves when it is off."""
    fps, accelerates = 240.0, 1.2
    rest = np.zeros(int(2.0 * fps))
    held = finger * accelerates * np.arange(1, int(0.2 * fps)) / fps
    free = held[-1] + accelerates * np.arange(1, int(1.2 * fps)) / fps
    found = hand_frame(slid(np.concatenate([rest, held, free]), fps))
    assert found == pytest.approx(len(rest) + len(held), abs=0.06 * fps)


def test_a_late_release_is_no_hand():
    late = np.concatenate([np.zeros(700), 1.2 * np.arange(1, 200) / 240])
    assert hand_frame(slid(late, 240.0)) is None


def test_a_held_and_struck_run_is_what_lies_between(tmp_path):
    """A finger holds the block back at first, and it bounces off the end stop and slides on."""
    held, free = 0.3 * np.arange(1, 12) / 60, 0.05 + 1.2 * np.arange(1, 60) / 60
    on = 1.2 * np.arange(1, 30) / 60 - 0.5
    speed = np.concatenate([np.zeros(40), held, free, on])
    path = write_clip(tmp_path, "incline", "ramp_angle_deg: 22.9\n", speed)
    path.write_text(path.read_text().replace("[0.03]", "null"))
    measured = measure(load_clip(path))
    hand, blow = measured.cuts
    assert (hand.why, hand.side, blow.why, blow.side) == (HELD, "before", STRUCK, "after")
    assert hand.time_s == pytest.approx(51 / 60, abs=0.1)
    assert blow.time_s == pytest.approx(110 / 60)
    assert measured.clip.starts_moving
    problem = make_problem(measured.clip, measured.observation)
    assert "start_speed" in problem.model.names
    assert "release_instant" not in problem.model.names


@pytest.mark.parametrize("steps", [1, 2])
def test_the_frames_of_a_blow_go_too(steps):
    """It falls, is struck for one step or two, and rises: what was struck is not used."""
    rng = np.random.default_rng(steps)
    way, sd = np.linspace(-2.4, 2.4, steps + 2)[1:-1], 5e-5
    speed = np.concatenate([np.full(12, -2.4), way, np.full(26, 2.4)])
    y = np.concatenate([[0.0], np.cumsum(speed / 250)])
    place = np.stack([0.8 * np.arange(len(y)) / 250, y]) + sd * rng.standard_normal((2, len(y)))
    assert blow_frame(seen(place, np.arange(len(y)) / 250, sd)) == 12


def flight_with_clock(clock: np.ndarray, bounce: float | None = None) -> Observation:
    """A throw at true times `clock`, written at 60 frames/s; with a blow in its middle or not."""
    place = np.array([1.5 * clock, 2.0 * clock - 9.81 / 2 * clock**2])
    if bounce is not None:
        half = len(clock) // 2
        since = clock[half:] - clock[half]
        place[0, half:] += (bounce - 1.5) * since
    return seen(place, np.arange(len(clock)) / 60, 3e-4, seed=8)


def test_slow_motion_within_a_film_is_named(tmp_path):
    """From 30 pictures a second on to 120 played as slowly: speed a quarter, acceleration 1/16."""
    clip = load_clip(write_clip(tmp_path, "flight"))
    steps = np.repeat([1 / 60, 1 / 240], [25, 60])
    clock = np.cumsum(steps) - steps[0]
    (found,) = segment(clip, flight_with_clock(clock)).cuts
    assert "goes on 0.2" in found.why and "the frame rate changes there" in found.why
    assert found.time_s == pytest.approx(24 / 60, abs=3 / 60)


def test_slow_motion_soon_after_a_release_is_named(tmp_path):
    """It was at rest in the frames before, and the jump of its clock looks like a blow as well."""
    clip = load_clip(write_clip(tmp_path, "fall"))
    clock = np.cumsum(np.repeat([1 / 60, 1 / 240], [26, 60]))
    fallen = 4.905 * np.maximum(clock - 13 / 60, 0) ** 2
    observed = seen(np.stack([0 * clock, 2 - fallen]), np.arange(86) / 60, 3e-4, seed=3)
    (found,) = segment(clip, observed).cuts
    assert "goes on 0.2" in found.why and "the frame rate changes there" in found.why
    assert found.time_s == pytest.approx(25 / 60, abs=1.5 / 60)


def test_a_blow_is_no_change_of_the_rate(tmp_path):
    clip = load_clip(write_clip(tmp_path, "flight"))
    (found,) = segment(clip, flight_with_clock(np.arange(60) / 60, bounce=-5.0)).cuts
    assert found.why == STRUCK
