"""A frame rate wrong by a factor is told of, with the likely one; effects are not taken for it."""

import math
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import yaml

from galileo_jax.clip.load import load_clip
from galileo_jax.clip.schema import Clip
from galileo_jax.clip.track_csv import write_observation_csv
from galileo_jax.measurement.check_frame_rate import (
    apparent_gravity,
    frame_rate_doubt,
    thread_doubt,
)
from galileo_jax.measurement.measure import measure
from galileo_jax.measurement.path_direction import path_doubt
from galileo_jax.observation.observation import Observation
from tests.measurement.seen import seen as observed_at
from tests.oracle_run import HIT, make_run
from tests.reference_ramp import solve

NOISE_M = 2e-4
FPS = 60.0


def ramp(tmp_path) -> tuple[Clip, Observation]:
    """The closed form, at 60 frames/s."""
    clip = make_run(tmp_path, HIT, 1.6).clip.model_copy(update={"fps": FPS})
    times = np.arange(96) / FPS
    centres = solve(HIT, times).position_m
    return clip, observed_at(centres, times, NOISE_M, seed=0)


def fall(tmp_path, gravity: float = 9.81) -> tuple[Clip, Observation]:
    times = np.arange(40) / FPS
    away = np.maximum(times - 0.1, 0.0)
    y = 1.5 - 0.5 * gravity * away**2 + NOISE_M * np.random.default_rng(0).standard_normal(40)
    seen = observed_at(np.stack([0 * y, y]), times, NOISE_M)
    write_observation_csv(tmp_path / "fall.csv", seen)
    ball = {"name": "object1", "shape": "sphere", "size_m": [0.03]}
    keys = {"track": "fall.csv", "scenario": "fall", "fps": FPS, "objects": [ball]}
    (tmp_path / "fall.yaml").write_text(yaml.safe_dump(keys))
    return load_clip(tmp_path / "fall.yaml"), seen


def off(clip: Clip, seen: Observation, factor: float, container: float | None = None):
    """The same with a rate that is `factor` times the true one."""
    wrong = clip.model_copy(update={"fps": factor * clip.fps, "container_fps": container})
    return wrong, replace(seen, times_s=seen.times_s / factor)


@pytest.mark.parametrize("make", [ramp, fall])
def test_the_right_clock_is_not_doubted(make, tmp_path):
    clip, seen = make(tmp_path)
    found = apparent_gravity(clip, seen)
    assert found is not None and found.value == pytest.approx(9.81, rel=0.15)
    assert frame_rate_doubt(clip, seen) is None


@pytest.mark.parametrize("make", [ramp, fall])
@pytest.mark.parametrize("factor", [0.125, 0.5, 2.0, 10.0])
def test_a_factor_is_told_with_the_likely_rate(make, factor, tmp_path):
    clip, seen = make(tmp_path)
    told = frame_rate_doubt(*off(clip, seen, factor))
    assert told is not None
    assert f"fps: {factor * FPS:g}, but" in told and "likely fps: " in told
    likely = float(told.split("likely fps: ")[1].split()[0])
    assert likely == pytest.approx(FPS, rel=0.02)


@pytest.mark.parametrize("stretch", [1 - 1e-9, 1.0, 1 + 1e-9])
def test_no_rounding_decides_between_a_rate_and_a_unit(stretch, tmp_path):
    """Ten times the rate and a hundredth of a metre say the same of gravity."""
    clip, seen = fall(tmp_path)
    seen = replace(seen, position_m=stretch * seen.position_m)
    told = frame_rate_doubt(*off(clip, seen, 10.0))
    assert told is not None and "likely fps: " in told and "(or its columns in cm" in told


def test_the_container_is_believed_where_gravity_agrees(tmp_path):
    clip, seen = fall(tmp_path)
    told = frame_rate_doubt(*off(clip, seen, 10.0, container=61.0))
    assert told is not None and "likely fps: 61, as the container says" in told
    told = frame_rate_doubt(*off(clip, seen, 10.0, container=30.0))
    assert told is not None and "container says" not in told


@pytest.mark.parametrize("gravity", [5.0, 9.0, 15.0])
def test_drags_and_small_errors_are_not_taken_for_it(gravity, tmp_path):
    clip, seen = fall(tmp_path, gravity)
    assert frame_rate_doubt(clip, seen) is None


def test_a_measurement_has_it(tmp_path):
    clip, seen = fall(tmp_path)
    clip, seen = off(clip, seen, 10.0)
    write_observation_csv(tmp_path / "fall.csv", seen)
    measured = measure(clip)
    (doubt,) = measured.doubts
    assert doubt == frame_rate_doubt(clip, seen) and "likely fps: 60" in doubt
    assert doubt == f"{clip.path}: {measured.impossible}"


@pytest.mark.parametrize(
    ("per_metre", "unit"), [(3.2808, "ft"), (39.37, "in"), (100.0, "cm"), (1000.0, "mm")]
)
def test_a_unit_is_likelier_than_another_rate(per_metre, unit, tmp_path):
    """Of a table of another program that is declared in metres."""
    clip, seen = fall(tmp_path)
    clip = clip.model_copy(update={"is_own_track": False})
    doubt = frame_rate_doubt(clip, replace(seen, position_m=per_metre * seen.position_m))
    assert doubt is not None and f"likely track_units: {unit}, with which it would be " in doubt
    value = float(doubt.split("it would be ")[1].split()[0])
    assert value == pytest.approx(9.81, rel=0.06)
    assert "likely fps" not in doubt


@pytest.mark.parametrize(("slope", "is_said"), [(0.0, True), (70.0, False)])
def test_what_goes_across_does_not_fall(slope, is_said, tmp_path):
    """A hand, perhaps, that was followed in place of the ball."""
    clip, seen = fall(tmp_path)
    way, angle = 4.0 * seen.times_s**2, math.radians(slope)
    place = np.stack([way * math.cos(angle), -way * math.sin(angle)])
    doubt = path_doubt(clip, replace(seen, position_m=place[None]))
    assert (doubt is not None and "--point" in doubt) == is_said


def test_nonsense_is_not_likely(tmp_path):
    """What is 5,000 times too slow was not filmed at another rate."""
    clip, seen = fall(tmp_path)
    clip = clip.model_copy(update={"is_own_track": False})
    doubt = frame_rate_doubt(clip, replace(seen, position_m=2e-4 * seen.position_m))
    assert doubt is not None and "no usual rate explains that" in doubt and "; likely" not in doubt


def table(
    folder: Path, keys: dict, times: np.ndarray, place: np.ndarray, noise_m: float = 0.01
) -> tuple:
    """A clip of a table in metres and what is seen in it, with errors of 10 mm."""
    noise = noise_m * np.random.default_rng(3).standard_normal(place.shape)
    rows = [f"{t},{x},{y}" for t, x, y in zip(times, *(place + noise), strict=True)]
    (folder / "a.csv").write_text("\n".join(["t (s),x (m),y (m)", *rows]) + "\n")
    declared = {"track": "a.csv", "objects": [{"name": "ball", "shape": "sphere"}]} | keys
    (folder / "a.yaml").write_text(yaml.safe_dump(declared))
    clip = load_clip(folder / "a.yaml")
    return clip, measure(clip).whole


def test_what_nothing_brakes_tells_the_rate_to_some_per_cent(tmp_path):
    """Half as long: a factor of 1.41 in the rate, which no camera has."""
    times = np.arange(40) / 60
    throw = np.stack([2 * times, 3 * times - 4.905 * times**2])
    clip, seen = table(tmp_path, {"scenario": "flight", "track_y": "up"}, times, throw / 2)
    doubt = frame_rate_doubt(clip, seen)
    assert (
        doubt is not None and "lengths 2.02 times as long would" in doubt and "likely" not in doubt
    )


def test_what_soon_falls_steadily_is_no_slow_clock(tmp_path):
    """A paper cup: v = sqrt(g / c) tanh(sqrt(g c) t)."""
    times, drag = np.arange(42) / 30, 3.8
    fallen = np.log(np.cosh(np.sqrt(9.81 * drag) * np.maximum(times - 0.25, 0))) / drag
    clip, _ = fall(tmp_path)
    seen = observed_at(np.stack([0 * times, 2.5 - fallen]), times, 1e-3, seed=0)
    found = apparent_gravity(clip, seen)
    assert found is not None and found.is_least
    assert frame_rate_doubt(clip, seen) is None


@pytest.mark.parametrize(("slope", "is_said"), [(24.0, True), (0.0, False)])
def test_a_straight_way_down_is_no_swing(slope, is_said, tmp_path):
    times = np.arange(40) / 30
    way = 3.0 * times**2 if is_said else 0.3 * np.cos(4 * times)
    angle = np.radians(slope)
    place = np.stack([way * np.cos(angle), 1.0 - way * np.sin(angle) + (0 if is_said else way**2)])
    clip, seen = table(tmp_path, {"scenario": "pendulum"}, times, place)
    assert (path_doubt(clip, seen) is not None) == is_said


def test_eleven_coarse_rows_tell_enough(tmp_path):
    """Whose windows scatter by half: one parabola through all tells gravity to a tenth."""
    t = np.arange(11) / 15
    place = np.array([1.5 * t, 3.0 * t - 9.81 / 2 * t**2])
    clip, seen = table(tmp_path, {"scenario": "flight", "track_y": "up"}, t * 15 / 25, place)
    doubt = frame_rate_doubt(clip, seen)
    assert doubt is not None and "likely fps: 15" in doubt and "27" in doubt


@pytest.mark.parametrize("thread", [{"thread_m": 0.5}, {}], ids=["declared", "by_its_arc"])
@pytest.mark.parametrize(("rate", "is_said"), [(1.0, False), (0.5, True), (4.0, True)])
def test_a_pendulum_tells_the_rate(rate, is_said, thread, tmp_path):
    t = np.arange(120) / 60
    angle = 0.3 * np.cos(math.sqrt(9.81 / 0.5) * t)
    place = 0.5 * np.array([np.sin(angle), -np.cos(angle)])
    keys = {"scenario": "pendulum", "track_y": "up", **thread}
    clip, seen = table(tmp_path, keys, t / rate, place, 1e-3)
    doubt = frame_rate_doubt(clip, seen)
    assert (doubt is not None) == is_said
    if doubt is not None:
        assert re.search("likely fps: (60|59.94)", doubt) and "track_units" not in doubt


@pytest.mark.parametrize(("thread_m", "is_said"), [(0.5, False), (0.55, False), (1.0, True)])
def test_an_arc_tells_that_a_thread_is_another(thread_m, is_said, tmp_path):
    t = np.arange(120) / 60
    angle = 0.4 * np.cos(math.sqrt(9.81 / 0.5) * t)
    place = 0.5 * np.array([np.sin(angle), -np.cos(angle)])
    keys = {"scenario": "pendulum", "thread_m": thread_m, "track_y": "up"}
    clip, seen = table(tmp_path, keys, t, place, 1e-3)
    doubt = thread_doubt(clip, seen)
    assert (doubt is not None) == is_said
    if doubt is not None:
        told = re.search(r"radius ([\d.]+) .* that of ([\d.]+)", doubt)
        assert told is not None
        arc, by_period = map(float, told.groups())
        assert arc == pytest.approx(0.5, rel=0.03) and by_period == pytest.approx(0.5, rel=0.05)


@pytest.mark.parametrize(("per_metre", "is_said"), [(1.0, False), (100.0, True)])
def test_a_level_table_in_centimetres(per_metre, is_said, tmp_path):
    t = np.arange(60) / 60
    place = per_metre * np.array([1.0 * t - 0.3 * t**2, 0 * t])
    clip, seen = table(tmp_path, {"scenario": "level"}, t, place)
    doubt = frame_rate_doubt(clip, seen)
    assert (doubt is not None) == is_said
    assert doubt is None or "likely track_units: cm | mm | in (or fps: 24 or less)" in doubt


@pytest.mark.parametrize("factor", [0.65, 1.5])
def test_half_of_gravity_and_twice_are_no_gravity(factor, tmp_path):
    clip, seen = off(*fall(tmp_path), factor)
    seen = seen.between(slice(6, None))  # without the rest, which is no parabola
    assert "gravity would be" in (frame_rate_doubt(clip, seen) or "")


@pytest.mark.parametrize(
    ("scenario", "speeds_up", "says"),
    [
        ("incline", 3.2, None),
        ("incline", 4.6, "a slope of 22 degrees gives 3.67 without any friction"),
        ("level", -1.0, None),
        ("level", 0.8, "on the level, where friction only slows it down"),
    ],
)
def test_what_speeds_up_more_than_its_slope_lets_it_is_said(scenario, speeds_up, says, tmp_path):
    times, angle = np.arange(40) / FPS, math.radians(22.0 if scenario == "incline" else 0.0)
    gone = 0.9 * times + speeds_up * times**2 / 2
    place = np.stack([gone * math.cos(angle), 0.5 - gone * math.sin(angle)])
    place += NOISE_M * np.random.default_rng(0).standard_normal(place.shape)
    path, table = tmp_path / "a.yaml", np.column_stack([times, *place])
    np.savetxt(tmp_path / "a.csv", table, "%.5f", ",", header="t (s),x (m),y (m)", comments="")
    slope = "ramp_angle_deg: 22\n" if scenario == "incline" else ""
    path.write_text(
        f"track: a.csv\nscenario: {scenario}\n{slope}objects:\n- {{name: block, shape: box}}\n"
    )
    found = " ".join(measure(load_clip(path)).doubts)
    assert says in found if says else not found
