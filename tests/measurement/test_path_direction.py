"""A path that does not go where it is declared to go is said; turned axes are turned back."""

import math
from pathlib import Path

import numpy as np
import pytest

import galileo_jax as gx
from galileo_jax.clip.load import load_clip
from galileo_jax.measurement.measure import measure
from tests.tracking.moving_box import Box, film
from tests.video.make_video import write_film

K1, NOISE_M, G = 0.2, 3e-4, 9.81


def write(folder: Path, falls_deg: float, scenario: str, acceleration: float) -> Path:
    """From rest, along a straight line that falls by an angle in the table's axes."""
    t = np.arange(40) / 40
    angle = math.radians(falls_deg)
    place = np.outer([math.cos(angle), -math.sin(angle)], acceleration * t**2 / 2)
    place += NOISE_M * np.random.default_rng(2).standard_normal(place.shape)
    rows = [f"{a},{x},{y},{NOISE_M}" for a, x, y in zip(t, *place, strict=True)]
    head = "time_s,object1_x_m,object1_y_m,object1_sd_m"
    (folder / "run.csv").write_text("\n".join([head, *rows]) + "\n")
    path = folder / "run.yaml"
    path.write_text(
        f"track: run.csv\nscenario: {scenario}\nobjects: [{{name: object1, shape: box}}]\n"
    )
    return path


def slide(folder: Path, path_deg: float, true_deg: float = 25.0) -> Path:
    angle = math.radians(true_deg)
    acceleration = G * (math.sin(angle) - K1 * math.cos(angle))
    return write(folder, path_deg, "incline\nramp_angle_deg: 25", acceleration)


@pytest.mark.parametrize("path_deg", [32.0, -25.0])
def test_turned_axes_are_turned_back_and_both_angles_are_said(tmp_path, path_deg):
    found = gx.fit(slide(tmp_path, path_deg))
    assert abs(found.parameters["k1"]["mean"] - K1) < 0.004
    assert found.result["error"]["chi2_per_dof"] < 1.5
    (said,) = (line for line in found.warnings if "degrees, but" in line)
    assert "ramp_angle_deg: 25 is declared; the axes are taken to be turned" in said
    assert f"by {abs(path_deg):.1f} +- " in said


def test_what_k1_is_with_the_other_angle(tmp_path):
    """The same acceleration on the steeper board: with the path's angle that is another k1."""
    found = gx.fit(slide(tmp_path, path_deg=32.0, true_deg=25.0))
    a, b = math.radians(25), math.radians(32)
    other = math.tan(b) - (math.sin(a) - K1 * math.cos(a)) / math.cos(b)
    (said,) = (line for line in found.warnings if "if the board falls by 32.0 degrees" in line)
    assert float(said.rsplit(" ", 1)[1]) == pytest.approx(other, abs=0.003)


def test_an_angle_that_is_fitted_is_no_other_angle(tmp_path):
    found = gx.fit(slide(tmp_path, path_deg=28.0, true_deg=28.0), effects=["ramp_angle"])
    assert abs(found.parameters["ramp_angle"]["mean"] - math.radians(3)) < 0.01
    assert not any("if the board falls" in line for line in found.warnings)


@pytest.mark.parametrize(("path_deg", "is_said"), [(25.3, False), (26.0, False), (28.0, True)])
def test_an_angle_that_may_be_misread_is_said_and_not_turned(tmp_path, path_deg, is_said):
    measured = measure(load_clip(slide(tmp_path, path_deg)))
    assert (measured.way is not None) == is_said
    assert measured.way is None or not measured.way.is_turned_back
    x, y = measured.observation.position_m[0]
    along = np.polyfit(x, y, 1)[0]
    assert math.degrees(math.atan(-along)) == pytest.approx(path_deg, abs=0.1)
    assert any("which is used; check the angle" in line for line in measured.doubts) == is_said


@pytest.mark.parametrize("path_deg", [0.0, 180.0])
def test_an_axis_along_the_slope_is_the_way_down_it(tmp_path, path_deg):
    found = gx.fit(slide(tmp_path, path_deg))
    assert abs(found.parameters["k1"]["mean"] - K1) < 0.004
    assert found.result["error"]["chi2_per_dof"] < 1.5
    (measured,) = found.measurements
    assert any("the axes are taken to be turned" in line for line in measured.warnings)


def test_a_fall_along_x(tmp_path):
    with pytest.raises(gx.InputError, match=r"falls along \+x, .* write track_up: -x"):
        gx.fit(write(tmp_path, 0.0, "fall", G), free=["gravity"])


def level(
    folder: Path, push_s: float = 0.0, noise_y_m: float = NOISE_M, rest_s: float = 0.0
) -> Path:
    """Pushed from rest for a while, if at all; then slower and slower, to a stop."""
    t = np.arange(160) / 100 - rest_s
    speed = np.where(t < push_s, 0.9 * t / max(push_s, 1e-9), 0.9 - K1 * G * (t - push_s))
    x = np.concatenate([[0.0], np.cumsum(np.clip(speed, 0, None))[:-1]]) / 100
    noise = np.random.default_rng(4).standard_normal((2, 160)) * [[NOISE_M], [noise_y_m]]
    rows = [
        f"{a},{b},{c},{NOISE_M}" for a, b, c in zip(t + rest_s, x + noise[0], noise[1], strict=True)
    ]
    head = "time_s,object1_x_m,object1_y_m,object1_sd_m"
    (folder / "run.csv").write_text("\n".join([head, *rows]) + "\n")
    path = folder / "run.yaml"
    path.write_text("track: run.csv\nscenario: level\nobjects: [{name: object1, shape: box}]\n")
    return path


@pytest.mark.parametrize("noise_y_m", [NOISE_M, 0.0])
def test_a_slide_along_a_level_table(tmp_path, noise_y_m):
    found = gx.fit(level(tmp_path, noise_y_m=noise_y_m))
    assert abs(found.parameters["k1"]["mean"] - K1) < 0.003
    assert found.parameters["start_speed"]["mean"] == pytest.approx(0.9, abs=0.02)
    assert found.parameters["k1"]["identified"]
    found.save(tmp_path / "out")
    again = gx.load_run(tmp_path / "out")
    assert again.parameters["k1"]["mean"] == found.parameters["k1"]["mean"]


@pytest.mark.parametrize(("rest_s", "push_s"), [(0.0, 0.2), (0.3, 0.2), (0.3, 0.08), (0.3, 0.05)])
def test_the_push_is_left_out(rest_s, push_s, tmp_path):
    """However short: it is no blow by something that is not in the scene."""
    measured = measure(load_clip(level(tmp_path, push_s, rest_s=rest_s)))
    (cut,) = measured.cuts
    assert cut.side == "before" and "is pushed by a hand" in cut.why
    assert cut.time_s == pytest.approx(rest_s + push_s, abs=0.06)


def test_a_level_table_has_no_angle(tmp_path):
    path = level(tmp_path)
    path.write_text(path.read_text() + "ramp_angle_deg: 2\n")
    with pytest.raises(gx.InputError, match="ramp_angle_deg: 2 given; scenario level"):
        load_clip(path)


@pytest.mark.parametrize("said", ["null", "20", "20\ndirection: left", "20\ntrack_y: down"])
def test_what_is_pushed_up_a_board_tells_where_it_falls(tmp_path, said):
    """Up to the right, and back, in a picture's pixels."""
    angle, start_m_s, px_per_m = math.radians(20), 2.0, 1000
    times = np.arange(60) / 60
    up, down = (G * (math.sin(angle) + sign * K1 * math.cos(angle)) for sign in (1, -1))
    since_top = np.clip(times - start_m_s / up, 0, None)
    rising = np.minimum(times, start_m_s / up)
    gone = start_m_s * rising - up * rising**2 / 2 - down * since_top**2 / 2
    place = np.outer([math.cos(angle), -math.sin(angle)], px_per_m * gone)
    place += np.array([[200], [560]])
    place += 0.1 * np.random.default_rng(0).standard_normal(place.shape)
    rows = [f"{t},{x},{y}" for t, x, y in zip(times, *place, strict=True)]
    (tmp_path / "up.csv").write_text("\n".join(["t,x,y", *rows]) + "\n")
    path = tmp_path / "up.yaml"
    path.write_text(
        "track: up.csv\ntrack_units: px\nscenario: incline\n"
        f"ramp_angle_deg: {said}\npixels_per_metre: {px_per_m}\n"
        "objects: [{name: object1, shape: box}]\n"
    )
    measured = measure(load_clip(path))
    assert measured.clip.direction == "left" and measured.way is None
    assert measured.clip.ramp_angle_deg == pytest.approx(20, abs=0.1)
    assert any("goes up to the right" in line for line in measured.remarks) == ("left" not in said)
    found = gx.fit(path).parameters["k1"]
    assert found["q025"] - 0.002 < K1 < found["q975"] + 0.002


def test_a_spring_on_a_level_track(tmp_path):
    """It swings along the track, and no angle is wrong."""
    times = np.arange(120) / 60
    place = np.stack([0.1 * np.cos(2 * math.pi * times), np.zeros(120)])
    place += NOISE_M * np.random.default_rng(0).standard_normal(place.shape)
    rows = [f"{t},{x},{y},{NOISE_M}" for t, x, y in zip(times, *place, strict=True)]
    head = "time_s,object1_x_m,object1_y_m,object1_sd_m"
    (tmp_path / "run.csv").write_text("\n".join([head, *rows]) + "\n")
    path = tmp_path / "run.yaml"
    path.write_text("track: run.csv\nscenario: spring\nobjects: [{name: object1, shape: box}]\n")
    found = gx.fit(path)
    assert found.parameters["period"]["mean"] == pytest.approx(1.0, abs=0.001)
    (said,) = (line for line in found.warnings if "not straight down" in line)
    assert "object1 swings along a line that" in said and "turned" not in said


@pytest.mark.video
def test_what_falls_across_is_said_before_its_gravity(tmp_path):
    """No clock and no scale explains that: it is another thing, or a camera on its side."""
    t = np.arange(30) / 60
    path = np.stack([30 + 700 * t**2, 60 + 0 * t, 0 * t], axis=1)
    write_film(tmp_path / "a.mp4", film([(Box((16, 16)), path)]), fps=60, options={"crf": "10"})
    (tmp_path / "a.yaml").write_text(
        "video: a.mp4\nscenario: fall\nfps: 60\npixels_per_metre: 100\n"
        "objects: [{name: object1, shape: box, point_px: [30, 60]}]\n"
    )
    said = measure(load_clip(tmp_path / "a.yaml")).impossible
    assert said is not None and said.startswith("object1 goes across by")


def test_a_throw_that_is_declared_as_a_fall_is_said_before_its_gravity(tmp_path):
    """Its axes are not turned, though it goes farther across than down."""
    t = np.arange(25) / 30
    noise = 1e-3 * np.random.default_rng(0).standard_normal((2, 25))
    x, y = np.stack([2.0 * t, 3.4 * t - 4.905 * t**2]) + noise
    rows = "\n".join(f"{a:.4f},{b:.4f},{c:.4f}" for a, b, c in zip(t, x, y, strict=True))
    (tmp_path / "a.csv").write_text(f"t (s),x (m),y (m)\n{rows}\n")
    (tmp_path / "a.yaml").write_text(
        "track: a.csv\nscenario: fall\nobjects: [{name: object1, shape: sphere}]\n"
    )
    said = measure(load_clip(tmp_path / "a.yaml")).impossible
    assert said is not None and "perhaps scenario: flight" in said


@pytest.mark.parametrize(("share", "is_said"), [(0.0, True), (1.0, False)])
def test_a_circle_seen_from_above_is_no_pendulum(share: float, is_said: bool, tmp_path):
    """Of what hangs, and goes over the top, the speed tells above from below."""
    t, angle, rate = np.arange(60) / 30, [0.0], 11.0
    length = 0.4
    for _ in t[1:]:
        for _ in range(20):
            rate -= share * 9.81 / length * math.sin(angle[-1]) / 600
            angle[-1] += rate / 600
        angle.append(angle[-1])
    x, y = length * np.sin(angle), -length * np.cos(angle)
    rows = "\n".join(f"{a:.4f},{b:.4f},{c:.4f}" for a, b, c in zip(t, x, y, strict=True))
    (tmp_path / "a.csv").write_text(f"t (s),x (m),y (m)\n{rows}\n")
    (tmp_path / "a.yaml").write_text(
        "track: a.csv\nscenario: pendulum\ntrack_y: up\nobjects: [{name: object1, shape: sphere}]\n"
    )
    said = measure(load_clip(tmp_path / "a.yaml")).impossible
    assert ("round and round" in (said or "")) == is_said


def test_a_slope_all_the_way_is_no_ramp_with_a_table(tmp_path):
    path = write(tmp_path, 20.0, "ramp\nramp_angle_deg: 20", 1.0)
    (said,) = (line for line in measure(load_clip(path)).warnings if "table is level" in line)
    assert "goes straight down by 20.0 degrees" in said
    assert "perhaps scenario: incline" in said


@pytest.mark.parametrize("share, is_said", [(0.24, False), (0.6, False), (None, True)])
def test_what_speeds_up_all_the_way_hangs_on_no_spring(share, is_said, tmp_path):
    """A quarter of a swing from its turn, more than half of one, and a fall."""
    t = np.arange(40) / 40
    y = -0.1 * t**2 if share is None else 0.1 * np.cos(2 * np.pi * share * t / t[-1])
    y = y + 1e-4 * np.random.default_rng(1).standard_normal(40)
    rows = "\n".join(f"{a:.4f},{b:.6f}" for a, b in zip(t, y, strict=True))
    (tmp_path / "a.csv").write_text(f"t (s),y (m)\n{rows}\n")
    (tmp_path / "a.yaml").write_text(
        "track: a.csv\nscenario: spring\nobjects: [{name: object1, shape: box}]\n"
    )
    said = measure(load_clip(tmp_path / "a.yaml")).impossible
    assert (said is not None and "speeds up all the way" in said) == is_said
