import json
from pathlib import Path

import numpy as np
import pytest
import yaml

import galileo_jax as gx
from galileo_jax.__main__ import main
from galileo_jax.api.look import look
from galileo_jax.clip.look import likely_in_plane
from galileo_jax.clip.schema import ClipFile
from galileo_jax.runtime.errors import InputError

T = np.arange(30) / 25
NOISE = np.random.default_rng(1).normal(0.3, 2e-3, (2, 30))


def write(path: Path, titles: str, *columns: np.ndarray) -> Path:
    rows = "\n".join(";".join(f"{v:.4f}" for v in row) for row in zip(*columns, strict=True))
    path.write_text(f"{titles}\n{rows}\n")
    return path


@pytest.mark.parametrize("titles, columns, scenario", [
    ("t (s);y (m)", (T, 2 - 4.905 * T**2), "fall"),
    ("t (s);s (m)", (T, 0.4 * T**2), "incline"),
    ("t (s);x (m);y (m)", (T, 2 * T, 3 * T - 4.905 * T**2), "flight"),
    ("t (s);x (mm)", (T, np.sin(20 * T)), "spring"),
    ("t (s);x (m);y (m)", (T, np.sin(14 * T), 0.5 * np.sin(14 * T) ** 2), "pendulum"),
])  # fmt: skip
def test_the_likely_scenario(titles, columns, scenario, tmp_path: Path) -> None:
    found = look(write(tmp_path / "a.csv", titles, *columns))
    assert found.seen is not None and found.seen.scenario == scenario
    said = yaml.safe_load(found.yaml)
    assert said["scenario"] == scenario and said["track"] == "a.csv"
    assert set(said) <= set(ClipFile.model_fields)


@pytest.mark.parametrize("titles, columns, why", [
    ("t (s);Höhe (m)", (T, 3 - 3 * np.log(np.cosh(1.4 * T))), "fall: a height"),
    ("t (s);x (m);y (m)", (T, *NOISE), "nothing moves"),
])  # fmt: skip
def test_why_it_may_be(titles, columns, why, tmp_path: Path) -> None:
    seen = look(write(tmp_path / "a.csv", titles, *columns)).seen
    assert seen is not None and not seen.is_clear
    assert why in f"{seen.scenario}: {seen.why}"


def test_a_swing_of_four_rows_moves() -> None:
    angle = np.arange(30) * np.pi / 2 + 0.3
    assert likely_in_plane(np.sin(angle), 0.1 * np.cos(angle)).swings > 3


def test_too_few_places(tmp_path: Path) -> None:
    path = write(tmp_path / "a.csv", "t (s);x (m);y (m)", T, T, np.full(30, np.nan))
    with pytest.raises(InputError, match="0 rows show a place; at least 4 expected"):
        look(path)


def test_summary_names_columns_gaps_and_what_is_not_known(tmp_path: Path, capsys) -> None:
    kept = np.delete(np.arange(30), [10, 11])
    path = write(tmp_path / "a.csv", "frame;x;v (m/s)", kept, kept**2.0, 2.0 * kept)
    assert main(["look", str(path), "--plot", str(tmp_path / "a.png")]) in (None, 0)
    out = capsys.readouterr().out
    for words in (
        "28 rows",
        "v (m/s)  not used",
        "after row 9 (3 steps)",
        "# fps",
        "# track_units",
    ):
        assert words in out
    assert (tmp_path / "a.png").stat().st_size > 0


@pytest.mark.parametrize("fps", [30, 60, 240])
def test_the_step_of_times_that_were_rounded(fps: int, tmp_path: Path) -> None:
    """0.000, 0.017, 0.033: 60 a second, not 58.8."""
    times = np.arange(40) / fps
    rows = [f"{t:.3f};{t**2:.6f}" for t in times]
    (tmp_path / "a.csv").write_text("\n".join(["t (s);s (m)", *rows]) + "\n")
    seen = look(tmp_path / "a.csv").seen
    assert seen is not None and seen.step == pytest.approx(1 / fps, rel=5e-3)


def test_what_is_no_file_is_one_line(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="no such file"):
        look(tmp_path / "none.csv")
    with pytest.raises(InputError, match="a table or a film expected"):
        look(tmp_path)


def test_a_yaml_that_is_there_is_named_and_no_other_is_proposed(tmp_path: Path, capsys) -> None:
    path = write(tmp_path / "a.csv", "t (s);y (m)", T, 2 - 4.905 * T**2)
    assert main(["look", str(path)]) in (None, 0)
    assert "a.yaml would be" in capsys.readouterr().out
    path.with_suffix(".yaml").write_text("track: a.csv\nscenario: flight\n")
    assert main(["look", str(path)]) in (None, 0)
    out = capsys.readouterr().out
    assert "a.yaml, which is there already" in out
    assert "would be" not in out and "objects:" not in out


def test_a_level_way_in_a_picture_is_no_slope():
    x = np.linspace(60.0, 900.0, 40)
    found = likely_in_plane(x, 400 + 0.002 * x)
    assert (found.scenario, found.is_clear) == ("level", False)


FILM_T = np.arange(60) / 60


def noisy(values: np.ndarray, seed: int) -> np.ndarray:
    return values + 0.3 * np.random.default_rng(seed).standard_normal(values.shape)  # px


@pytest.mark.parametrize("degrees", [10, 20, 30, 45])
def test_a_slope_and_then_a_level_is_a_ramp_with_a_table(degrees):
    way, on_ramp = 1200 * FILM_T**2, 500.0
    past, angle = np.clip(way - on_ramp, 0, None), np.radians(degrees)
    x = np.minimum(way, on_ramp) * np.cos(angle) + past
    y = np.minimum(way, on_ramp) * np.sin(angle)
    found = likely_in_plane(noisy(x, 1), noisy(y, 2))
    assert (found.scenario, found.is_clear) == ("ramp", True)


@pytest.mark.parametrize("up_px_s", [0.0, 300.0, 900.0])
def test_what_is_thrown_is_no_ramp_however_flat_it_ends(up_px_s):
    y = -up_px_s * FILM_T + 2000 * FILM_T**2
    found = likely_in_plane(noisy(700 * FILM_T, 1), noisy(y, 2))
    assert (found.scenario, found.is_clear) == ("flight", True)


@pytest.mark.parametrize("down", [1.0, -1.0])
@pytest.mark.parametrize("share", [0.5, 0.9])
def test_what_bounces_is_thrown_back_and_what_swings_is_not(share, down):
    height, speed, seen = 300.0, 0.0, []
    for _ in range(240):
        seen.append(height)
        for _ in range(20):
            speed -= 3000 / 1200
            height += speed / 1200
            if height < 0 > speed:
                speed *= -share
    bouncing = likely_in_plane(noisy(np.zeros(240), 1), down * noisy(np.array(seen), 2))
    assert (bouncing.scenario, bouncing.bounces, bouncing.is_clear) == ("fall", True, True)
    swinging = 150 * np.cos(np.arange(240) / 9) * np.exp(-np.arange(240) / 300)
    found = likely_in_plane(noisy(np.zeros(240), 1), noisy(swinging, 2))
    assert (found.scenario, found.bounces) == ("spring", False)


def test_the_yaml_of_what_bounces_has_a_floor(tmp_path: Path) -> None:
    gx.simulate(tmp_path / "made.csv", scenario="fall", floor=True, seed=2, track_only=True)
    (tmp_path / "made.csv").rename(tmp_path / "ball.csv")
    seen = look(tmp_path / "ball.csv").seen
    assert seen is not None and "floor: true" in seen.yaml


@pytest.mark.parametrize("name", ["slide.lvm", "slide", "slide.json", "slide.asc"])
def test_a_table_of_any_name_is_a_table(name: str, tmp_path: Path) -> None:
    path = tmp_path / name
    rows = [[n / 30, 0.5 * n**2] for n in range(20)]
    text = "\n".join(f"{t:.4f}\t{s:.2f}" for t, s in rows)
    path.write_text(json.dumps(rows) if name.endswith("json") else text)
    seen = gx.look(path).seen
    assert seen is not None and seen.num_rows == 20


@pytest.mark.parametrize("strays", [(), (11,), (7, 19)])
def test_a_place_that_was_marked_wrongly_makes_no_swing_of_a_throw(strays, tmp_path: Path) -> None:
    x, y = 2 * T, 3 * T - 4.905 * T**2
    for n in strays:
        x[n], y[n] = x[n] - 0.8, y[n] + 0.5
    found = look(write(tmp_path / "a.csv", "t (s);x (m);y (m)", T, x, y))
    assert found.seen is not None and found.seen.scenario == "flight"


def test_one_coordinate_that_is_thrown_back_falls(tmp_path: Path) -> None:
    """As a ball's height, which was held at first."""
    times = np.arange(150) / 50
    height, speed, place = 1.1, 0.0, []
    for now in times:
        place.append(height)
        for _ in range(20 if now > 0.5 else 0):
            height, speed = height + 1e-3 * speed, speed - 9.81e-3
            if height < 0 and speed < 0:
                height, speed = -height, -0.8 * speed
    found = look(write(tmp_path / "a.csv", "Time (s);Height (m)", times, np.array(place)))
    assert found.seen is not None and (found.seen.scenario, found.seen.bounces) == ("fall", True)
