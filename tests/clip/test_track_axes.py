"""One coordinate is enough along a line; axes that lie otherwise are found by the motion."""

from pathlib import Path

import numpy as np
import pytest

from galileo_jax.clip.load import load_clip
from galileo_jax.clip.track_axes import up_from_motion
from galileo_jax.measurement.measure import measure
from galileo_jax.observation.observation import UNMEASURED_SD_M, Observation
from galileo_jax.runtime.errors import InputError

T = np.arange(40) / 60
NOISE = np.random.default_rng(5).normal(0, 3e-4, (2, 40))
FALL = 1.5 - 4.905 * T**2 + NOISE[0]
WAY = 0.8 * T**2 + NOISE[1]


def observed(folder: Path, columns: dict[str, np.ndarray], keys: str) -> Observation:
    table = np.stack(list(columns.values())).T
    rows = "\n".join(",".join(f"{v:.6f}" for v in row) for row in table)
    (folder / "a.csv").write_text(",".join(columns) + "\n" + rows + "\n")
    (folder / "a.yaml").write_text(
        f"track: a.csv\n{keys}\nobjects: [{{name: object1, shape: box}}]\n"
    )
    return measure(load_clip(folder / "a.yaml")).observation


@pytest.mark.parametrize("sign", [1, -1])
def test_a_fall_by_its_height_or_depth(sign: int, tmp_path: Path) -> None:
    found = observed(tmp_path, {"t (s)": T, "s (m)": sign * FALL}, "scenario: fall")
    np.testing.assert_allclose(found.position_m[0, 1], FALL, atol=1e-6)
    sd = np.sqrt(np.einsum("aat->at", found.covariance_m2[0]))
    assert sd[0, 0] == UNMEASURED_SD_M and sd[1, 0] < 1e-3
    np.testing.assert_array_equal(np.abs(found.across[0, 0]), 1.0)


@pytest.mark.parametrize("seed", range(20))
def test_what_falls_at_its_terminal_speed_falls_down(seed: int) -> None:
    """As a coffee filter, whose acceleration shows at the beginning alone."""
    times = np.arange(40) / 30
    noise = np.random.default_rng(seed).normal(0, 1.5e-3, 40)
    height = 2.0 - np.log(np.cosh(7.0 * times)) / 5.0 + noise
    assert up_from_motion("bend", times, np.stack([0 * times, height])) == "up"
    assert up_from_motion("bend", times, np.stack([0 * times, -height])) == "down"


@pytest.mark.parametrize("declared", ["", "\ntrack_y: down"])
def test_a_sensor_above_measures_downwards_also_what_bounces(declared: str, tmp_path: Path) -> None:
    times = np.arange(150) / 50
    height, speed, place = 1.2, 0.0, []
    for _ in times:
        place.append(height)
        for _ in range(20):
            height, speed = height + 1e-3 * speed, speed - 9.81e-3
            if height < 0 and speed < 0:
                height, speed = -height, -0.8 * speed
    away = 1.5 - np.array(place) + np.random.default_rng(2).normal(0, 5e-4, 150)
    keys = f"scenario: fall\nfloor: true{declared}"
    found = observed(tmp_path, {"Time (s)": times, "Position (m)": away}, keys)
    assert np.corrcoef(found.position_m[0, 1], place)[0, 1] > 0.99


@pytest.mark.parametrize("columns", [
    {"t (s)": T, "x (m)": WAY},
    {"t (s)": T, "x (m)": -WAY},
    {"t (s)": T, "x (m)": WAY, "y (m)": NOISE[0]},
    {"t (s)": T, "x (m)": NOISE[0], "y (m)": WAY},
    {"time_s": T, "object1_x_m": WAY, "object1_y_m": 0 * T},
], ids=["way", "way_back", "level_with_errors", "upright", "own_csv"])  # fmt: skip
def test_the_way_down_a_slope(columns: dict[str, np.ndarray], tmp_path: Path) -> None:
    found = observed(tmp_path, columns, "scenario: incline\nramp_angle_deg: 10")
    angle = np.radians(10)
    along = np.array([np.cos(angle), -np.sin(angle)])
    np.testing.assert_allclose(along @ found.position_m[0], WAY, atol=2e-5)
    sd = np.sqrt(np.einsum("a,b,abt->t", along, along, found.covariance_m2[0]))
    assert 1e-4 < sd[0] < 6e-4  # 3e-4 was put in


@pytest.mark.parametrize(("title", "said"), [("x (m)", True), ("s (m)", False)])
def test_an_axis_alone_is_said_to_be_taken_for_the_way(title, said, tmp_path: Path) -> None:
    observed(tmp_path, {"t (s)": T, title: WAY}, "scenario: incline\nramp_angle_deg: 10")
    lines = load_clip(tmp_path / "a.yaml").warnings
    assert any("alone is taken for the way down the slope" in line for line in lines) == said


@pytest.mark.parametrize(
    ("title", "keys", "height"),
    [("y (m)", "", 0.5 - 0.5 * WAY), ("y (m)", "\ntrack_y: down", 0.5 * WAY),
     ("depth (m)", "", 0.5 * WAY), ("height (m)", "", 0.5 - 0.5 * WAY)],
)  # fmt: skip
def test_a_height_alone_tells_the_way_down_a_slope(title, keys, height, tmp_path: Path) -> None:
    columns = {"t (s)": T, title: height + NOISE[0]}
    found = observed(tmp_path, columns, "scenario: incline\nramp_angle_deg: 30" + keys)
    along = np.array([np.cos(np.radians(30)), -np.sin(np.radians(30))])
    way = along @ found.position_m[0]
    np.testing.assert_allclose(way - way[0], WAY - WAY[0], atol=4e-3)
    sd = np.sqrt(np.einsum("a,b,abt->t", along, along, found.covariance_m2[0]))
    assert 2e-4 < sd[0] < 12e-4  # twice that of the height, 3e-4
    assert any(
        "y alone" in line or title[:5] in line for line in load_clip(tmp_path / "a.yaml").warnings
    )


@pytest.mark.parametrize(("fps", "factor"), [(240.0, 8), (30.2, 1), (30.0, 1)])
def test_a_declared_rate_rescales_the_times_of_a_table(fps: float, factor: int, tmp_path: Path):
    """As of a film: 240 a second that are played as 30. A rate near theirs confirms them."""
    columns = {"t (s)": np.arange(40) / 30, "s (m)": WAY}
    found = observed(tmp_path, columns, f"scenario: incline\nramp_angle_deg: 10\nfps: {fps}")
    np.testing.assert_allclose(found.times_s, np.arange(40) / 30 / factor, atol=1e-5)
    said = [line for line in load_clip(tmp_path / "a.yaml").warnings if "rescaled" in line]
    assert len(said) == (factor > 1)


@pytest.mark.parametrize(("side", "up"), [(1, "-x"), (-1, "x")])
def test_an_arc_whose_pivot_lies_aside_says_what_to_declare(side: int, up: str, tmp_path: Path):
    """As a pendulum whose titles x and y were swapped."""
    angle = 0.4 * np.cos(9 * T)
    columns = {"t (s)": T, "x (m)": side * 0.5 * np.cos(angle), "y (m)": 0.5 * np.sin(angle)}
    with pytest.raises(InputError, match=f"an arc that hangs along .*write track_up: {up}"):
        observed(tmp_path, columns, "scenario: pendulum")
    turned = observed(tmp_path, columns, f"scenario: pendulum\ntrack_up: {up}")
    np.testing.assert_allclose(turned.position_m[0, 1], -0.5 * np.cos(angle), atol=1e-5)


def test_times_rounded_to_milliseconds_are_not_rescaled(tmp_path: Path):
    """Whose middle step says 250 a second where 240 are declared, and are there."""
    times = np.round(np.arange(120) / 240, 3)
    columns = {"t (s)": times, "s (m)": 0.3 * times**2}
    found = observed(tmp_path, columns, "scenario: incline\nramp_angle_deg: 10\nfps: 240")
    np.testing.assert_allclose(found.times_s, times)
    assert not any("rescaled" in line for line in load_clip(tmp_path / "a.yaml").warnings)


def test_a_fall_along_x_says_what_to_declare(tmp_path: Path) -> None:
    columns = {"t (s)": T, "x (m)": -FALL, "y (m)": NOISE[1]}
    with pytest.raises(InputError, match=r"falls along \+x, .* write track_up: -x"):
        observed(tmp_path, columns, "scenario: fall\ntrack_y: up")
    found = observed(tmp_path, columns, "scenario: fall\ntrack_up: -x")
    np.testing.assert_allclose(found.position_m[0, 1], FALL, atol=1e-6)


def test_a_flight_needs_two_coordinates(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"only one coordinate .* needs x and y; along a line are"):
        observed(tmp_path, {"t (s)": T, "y (m)": FALL}, "scenario: flight")


def test_a_third_axis_is_left_out_with_its_rounding(tmp_path: Path) -> None:
    columns = {"t (s)": T, "X (m)": 0.9 * T, "Y (m)": 0.2 + NOISE[1], "Z (m)": FALL}
    found = observed(tmp_path, columns, "scenario: flight\ntrack_up: z")
    np.testing.assert_allclose(found.position_m[0], [0.9 * T, FALL], atol=1e-6)


def test_a_pendulum_that_is_seen_from_below_swings_along_x_alone(tmp_path: Path) -> None:
    swing = 0.2 + 0.1 * np.cos(9.0 * T) + NOISE[0]
    found = observed(tmp_path, {"t (s)": T, "x (m)": swing}, "scenario: pendulum")
    np.testing.assert_allclose(np.abs(found.position_m[0, 0]), swing, atol=1e-6)
    assert (np.sqrt(found.covariance_m2[0, 1, 1]) == UNMEASURED_SD_M).all()
    np.testing.assert_array_equal(np.abs(found.across[0, 1]), 1.0)


def test_first_frame_is_honoured(tmp_path: Path) -> None:
    rows = "\n".join(f"{t:.4f},{x:.6f},{y:.6f}" for t, x, y in zip(T, T, FALL, strict=True))
    (tmp_path / "a.csv").write_text("t (s),x (m),y (m)\n" + rows + "\n")
    (tmp_path / "a.yaml").write_text(
        "track: a.csv\nscenario: flight\n"
        "objects: [{name: object1, shape: box, first_frame: 4, last_frame: 20}]\n"
    )
    mask = measure(load_clip(tmp_path / "a.yaml")).observation.mask[0]
    np.testing.assert_array_equal(np.flatnonzero(mask), np.arange(4, 21))


def test_lost_frames_are_named_and_their_time_put_back(tmp_path: Path) -> None:
    kept = np.delete(np.arange(40), [8, 15, 16, 27])
    columns = {"t (s)": T[: len(kept)], "x (m)": NOISE[1][kept], "y (m)": FALL[kept]}
    found = observed(tmp_path, columns, "scenario: fall")
    np.testing.assert_allclose(found.times_s, T[kept], atol=1e-4)
    assert "missing after rows 7, 13 (2), 23" in load_clip(tmp_path / "a.yaml").warnings[0]
    whole = observed(tmp_path, {"t (s)": T, "x (m)": NOISE[1], "y (m)": FALL}, "scenario: fall")
    np.testing.assert_allclose(whole.times_s, T, atol=1e-6)


def test_frames_are_lost_beside_one_that_was_not_seen(tmp_path: Path) -> None:
    kept = np.delete(np.arange(40), [15, 16, 27])
    fall = FALL[kept]
    fall[20] = np.nan
    columns = {"t (s)": T[: len(kept)], "x (m)": NOISE[1][kept], "y (m)": fall}
    found = observed(tmp_path, columns, "scenario: fall")
    np.testing.assert_allclose(found.times_s[21:], T[kept][21:], atol=1e-4)
    assert "missing after rows 14 (2), 24" in load_clip(tmp_path / "a.yaml").warnings[0]


def test_where_a_body_stops_no_frame_is_lost(tmp_path: Path) -> None:
    stopped = FALL[np.minimum(np.arange(40), 27)] + NOISE[1]
    columns = {"t (s)": T, "x (m)": NOISE[1], "y (m)": stopped}
    found = observed(tmp_path, columns, "scenario: fall")
    np.testing.assert_allclose(found.times_s, T[: len(found.times_s)], atol=1e-6)


def test_z_is_up_where_nothing_moves_along_y(tmp_path: Path) -> None:
    columns = {"t (s)": T, "x (m)": 0.9 * T, "y (m)": 0.2 + NOISE[1], "z (m)": FALL}
    found = observed(tmp_path, columns, "scenario: flight")
    assert np.ptp(found.position_m[0, 1]) == pytest.approx(np.ptp(FALL), abs=1e-5)
    assert any("z is taken as up" in one for one in load_clip(tmp_path / "a.yaml").warnings)


def test_the_floor_ends_a_fall_of_one_coordinate(tmp_path: Path) -> None:
    """What was not measured across does not hide what was."""
    times = np.arange(60) / 60
    height = np.maximum(1.5 - 4.905 * times**2, 0.4) + np.random.default_rng(2).normal(0, 3e-4, 60)
    seen = observed(tmp_path, {"t (s)": times, "y (m)": height}, "scenario: fall").mask[0]
    landed = np.sqrt(2 * 1.1 / 9.81)
    assert abs(times[np.flatnonzero(seen)[-1]] - landed) < 2 / 60


def test_a_spring_that_swings_along_x_and_wobbles(tmp_path: Path) -> None:
    """By a twentieth of its way: no straight path, but the axis is as clear."""
    times = np.arange(120) / 60
    swing, wobble = 0.1 * np.cos(9 * times), 0.005 * np.cos(23 * times)
    found = observed(
        tmp_path, {"t (s)": times, "x (m)": swing, "y (m)": wobble}, "scenario: spring"
    )
    assert abs(np.corrcoef(found.position_m[0, 1], swing)[0, 1]) > 0.999


@pytest.mark.parametrize("seed", range(8))
@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_what_a_track_leaps_to_does_not_hide_which_way_is_up(seed: int, sign: float) -> None:
    """A fall of 0.4 s, and then something else that rests."""
    times = np.arange(40) / 60
    height = np.where(times < 0.42, 1.4 - 4.905 * np.clip(times - 0.03, 0, None) ** 2, 0.66)
    place = np.stack([np.where(times < 0.42, 0.2, 0.83), sign * height])
    place += np.random.default_rng(seed).normal(0, 1e-3, place.shape)
    assert up_from_motion("bend", times, place) == ("up" if sign > 0 else "down")


def test_a_way_alone_is_asked_whether_it_rises_or_sinks(tmp_path: Path):
    """What sinks faster and faster, by its depth, would be taken for what rises."""
    depth = 0.02 + 0.3 * T**2 / (0.2 + T)
    columns, keys = {"time_s": T, "way_m": depth + NOISE[0]}, "scenario: liquid"
    told = observed(tmp_path, {"time_s": T, "depth_m": depth + NOISE[0]}, keys)
    assert told.position_m[0, 1, -1] < told.position_m[0, 1, 0]
    with pytest.raises(InputError, match=r"track_y: missing; .* rises if the way points up"):
        observed(tmp_path, columns, keys)
    down = observed(tmp_path, columns, keys + "\ntrack_y: down")
    assert down.position_m[0, 1, -1] < down.position_m[0, 1, 0]
    up = observed(tmp_path, {"time_s": T, "y_m": -depth + NOISE[0]}, keys)
    assert up.position_m[0, 1, -1] < up.position_m[0, 1, 0]


@pytest.mark.parametrize("turn_deg", [0.0, 35.0, -50.0])
def test_a_throw_askew_to_the_axes_of_a_room_is_one_in_its_plane(turn_deg, tmp_path: Path) -> None:
    """As motion capture gives it, y up."""
    way, height = 2.3 * T, 1 + 3 * T - 4.905 * T**2
    x, z = (way * one(np.radians(turn_deg)) for one in (np.cos, np.sin))
    columns = {"t (s)": T, "x (m)": x + NOISE[0], "y (m)": height, "z (m)": z + NOISE[1]}
    found = observed(tmp_path, columns, "scenario: flight")
    gone = found.position_m[0] - found.position_m[0][:, :1]
    np.testing.assert_allclose(gone, [way, height - 1], atol=2e-3)
