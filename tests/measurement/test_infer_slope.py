"""A ramp's angle from the path: right, with an error that contains the truth, or one line."""

import json
import math
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from galileo_jax.clip.load import load_clip
from galileo_jax.commands import command, export, fit
from galileo_jax.measurement.infer_ramp import LEVEL_SD_DEG, end_of_slope
from galileo_jax.measurement.measure import inferred, measure
from galileo_jax.observation.observation import Observation
from galileo_jax.runtime.errors import InputError
from tests.measurement.seen import seen

YAML = """\
track: slide.csv
scenario: {scenario}
ramp_angle_deg: null
objects: [{{name: object1, shape: box, size_m: [0.06, 0.05, 0.06]}}]
"""
NUM_FRAMES = 48
FPS = 60.0


def write_track(
    folder: Path,
    angle_deg: float = 20.0,
    acceleration: float = 1.6,
    scenario: str = "incline",
    seed: int = 1,
    noise_m: float = 5e-4,
) -> Path:
    """A box that slides from rest for 0.8 s; on a ramp it goes on along the table."""
    times = np.arange(NUM_FRAMES) / FPS
    along = 0.5 * acceleration * times**2
    start = -0.3 if scenario == "ramp" else 0.0
    angle = math.radians(angle_deg)
    on_ramp = np.minimum(start + along, 0.0) if scenario == "ramp" else along
    after = np.maximum(start + along, 0.0) if scenario == "ramp" else 0.0
    x = on_ramp * math.cos(angle) + after + 0.03 * math.sin(angle)
    y = -on_ramp * math.sin(angle) + 0.03 * math.cos(angle)
    x, y = np.array([x, y]) + np.random.default_rng(seed).normal(0, noise_m, (2, NUM_FRAMES))
    rows = "".join(
        f"{t:.6f},{a:.6f},{b:.6f},{noise_m:.6f}\n" for t, a, b in zip(times, x, y, strict=True)
    )
    (folder / "slide.csv").write_text("time_s,object1_x_m,object1_y_m,object1_sd_m\n" + rows)
    path = folder / "slide.yaml"
    path.write_text(YAML.format(scenario=scenario))
    return path


@pytest.mark.parametrize("scenario", ["incline", "ramp"])
@pytest.mark.parametrize("angle_deg", [8.0, 20.0, 35.0])
def test_angle_of_the_path(scenario: str, angle_deg: float, tmp_path: Path) -> None:
    measured = measure(load_clip(write_track(tmp_path, angle_deg, 2.0, scenario)))
    found = measured.inferred["ramp_angle_deg"]
    # 36 points of 0.5 mm over 0.2 m and more: 0.15 degrees at worst.
    assert found["mean"] == pytest.approx(angle_deg, abs=0.3)
    assert LEVEL_SD_DEG <= found["sd"] < 0.7
    assert measured.clip.ramp_angle_deg == found["mean"]
    assert measured.clip.ramp_angle_sd_deg == found["sd"]
    assert inferred([measured]) == {"inferred": {"slide": {"ramp_angle_deg": dict(found)}}}
    (line,) = measured.remarks
    assert "ramp_angle_deg: null; object1's path falls by" in line
    assert line.count("ramp_angle_deg") == 1


def test_scatter_enters_the_error(tmp_path: Path) -> None:
    """Over 40 noisy paths the stated error without the camera's part fits the misses."""
    misses, stated = [], []
    for seed in range(40):
        path = write_track(tmp_path, seed=seed, acceleration=0.5, noise_m=2e-3)
        found = measure(load_clip(path)).inferred["ramp_angle_deg"]
        misses.append(found["mean"] - 20.0)
        stated.append(math.sqrt(found["sd"] ** 2 - LEVEL_SD_DEG**2))
    assert np.std(misses) == pytest.approx(np.mean(stated), rel=0.35)
    assert abs(np.mean(misses)) < 3 * np.mean(stated) / math.sqrt(40)


@pytest.mark.parametrize("change, words", [
    ({"acceleration": 0.0}, "moves by only 0.00"),
    ({"angle_deg": 0.0}, "degrees: no ramp"),
    ({"angle_deg": -15.0}, "path falls by -15"),
    ({"angle_deg": 160.0}, "object1's x decreases; x along the travel"),
    ({"acceleration": 0.0, "scenario": "ramp"}, "too little to determine the slope"),
])  # fmt: skip
def test_what_cannot_be_told_is_one_line(change: dict, words: str, tmp_path: Path) -> None:
    clip = load_clip(write_track(tmp_path, **change))
    with pytest.raises(InputError) as caught:
        measure(clip)
    assert words in str(caught.value)
    assert "\n" not in str(caught.value)


def test_angle_must_be_given_or_null(tmp_path: Path) -> None:
    path = write_track(tmp_path)
    path.write_text(path.read_text().replace("ramp_angle_deg: null\n", ""))
    with pytest.raises(InputError, match=r"ramp_angle_deg: missing; .* or null"):
        load_clip(path)


@pytest.mark.slow
def test_inferred_angle_enters_the_fit(tmp_path: Path) -> None:
    """Friction's interval is wider by what the angle's error makes of it, and holds the truth."""
    out = tmp_path / "run"
    assert command.run(fit.main, [str(write_track(tmp_path)), "--out", str(out)]) == 0
    result = json.loads((out / "result.json").read_text())
    assert result["inferred"]["slide"]["ramp_angle_deg"]["sd"] >= LEVEL_SD_DEG
    assert "declared_angle" in " ".join(result["nuisances"])
    friction = math.tan(math.radians(20)) - 1.6 / (9.81 * math.cos(math.radians(20)))
    found = result["parameters"]["k1"]
    assert found["q025"] < friction < found["q975"]
    assert command.run(export.main, [str(out), "--to", "csv", "--fitted"]) == 0
    track = pd.read_csv(out / "export" / "track.csv")
    assert np.std(track["fitted_x_m"] - track["x_m"]) == pytest.approx(5e-4, rel=0.3)
    # d k / d angle = 1 + k tan(angle) per radian
    from_angle = math.radians(LEVEL_SD_DEG) * (1 + friction * math.tan(math.radians(20)))
    assert found["sd"] == pytest.approx(from_angle, rel=0.3)


def bent_path(turn_deg: float, length_m: float, seed: int = 0) -> Observation:
    """Down 17 degrees for 0.8 s, and on in a direction turned by `turn_deg` over `length_m`."""
    times = np.arange(72) / 60
    way = np.linspace(0.0, 1.2, 5001)
    turned = np.clip((way - 0.5 + length_m / 2) / max(length_m, 1e-9), 0, 1) * turn_deg
    angle = np.radians(turned - 17.0)
    path = np.cumsum(np.stack([np.cos(angle), np.sin(angle)]), axis=1) * (way[1] - way[0])
    gone = np.minimum(0.5 * 1.6 * times**2, 1.2)
    place = np.stack([np.interp(gone, way, one) for one in path])
    return seen(place, times, 5e-4, seed)


@pytest.mark.parametrize("turn_deg", [17.0, 8.0, -30.0])
@pytest.mark.parametrize("length_m", [0.0, 0.04])
def test_a_slope_ends_where_its_path_bends_at_one_place(turn_deg: float, length_m: float) -> None:
    """At 0.5 m, after 0.79 s."""
    for seed in range(5):
        last = end_of_slope(bent_path(turn_deg, length_m, seed))
        assert last is not None and 42 <= last <= 50


@pytest.mark.parametrize("turn_deg", [0.0, 3.0, 15.0, 40.0])
def test_a_board_that_is_bent_all_along_has_no_end(turn_deg: float) -> None:
    assert [end_of_slope(bent_path(turn_deg, 1.0, seed)) for seed in range(10)] == [None] * 10


@pytest.mark.parametrize("seed", range(5))
def test_a_slope_of_two_degrees_ends_on_the_level(seed: int) -> None:
    """A marble that rolls 0.9 m down and 2.4 m on, from the 26th frame on."""
    times, angle = np.arange(60) / 10, math.radians(2.2)
    speeds_up = 9.81 * math.sin(angle) / 1.4
    down = 0.5 * speeds_up * np.minimum(times, 2.6) ** 2
    on = speeds_up * 2.6 * np.clip(times - 2.6, 0, None)
    place = np.stack([down * math.cos(angle) + on, -down * math.sin(angle)])
    last = end_of_slope(seen(place, times, 8e-4, seed))
    assert last is not None and 24 <= last <= 32
