"""The release of a clip that does not say when object 1 was let go."""

import math
from pathlib import Path

import numpy as np
import pytest

from galileo_jax.assembly.build_scene import build_scene
from galileo_jax.clip.load import load_clip
from galileo_jax.measurement.measure import measure

HELD_S = 0.4
YAML = """\
track: held.csv
scenario: ramp
ramp_angle_deg: 20.0
objects: [{name: object1, shape: box, size_m: [0.06, 0.05, 0.06], first_frame: FRAME}]
"""


def write_track(folder: Path, first_frame: str) -> Path:
    """A box that is held for `HELD_S`, comes down the ramp and goes on along the table."""
    times, angle = np.arange(60) / 30, math.radians(20.0)
    since = np.clip(times - HELD_S, 0, None)
    along = -0.4 + 0.5 * 2.0 * since**2
    x = np.where(along < 0, along * math.cos(angle) + 0.03 * math.sin(angle), along)
    y = np.where(along < 0, -along * math.sin(angle) + 0.03 * math.cos(angle), 0.03)
    x, y = np.array([x, y]) + np.random.default_rng(2).normal(0, 5e-4, (2, 60))
    rows = [f"{t:.6f},{a:.6f},{b:.6f},0.0005" for t, a, b in zip(times, x, y, strict=True)]
    (folder / "held.csv").write_text(
        "\n".join(["time_s,object1_x_m,object1_y_m,object1_sd_m", *rows]) + "\n"
    )
    path = folder / "held.yaml"
    path.write_text(YAML.replace("FRAME", first_frame))
    return path


@pytest.mark.parametrize("first_frame, sd_s", [("12", 1 / 90), ("null", 0.1)])
def test_release(first_frame: str, sd_s: float, tmp_path: Path) -> None:
    measured = measure(load_clip(write_track(tmp_path, first_frame)))
    found = build_scene(measured.clip, measured.observation).surroundings.release_s
    assert found[0] == pytest.approx(HELD_S, abs=sd_s / 3)
    assert found[1] == pytest.approx(sd_s, rel=1e-4)


@pytest.mark.parametrize("first_frame, is_said", [("0", True), ("12", False), ("null", False)])
def test_a_rest_before_the_release_is_said(first_frame: str, is_said: bool, tmp_path: Path) -> None:
    """The release is taken to be in the first frame unless somebody says otherwise."""
    remarks = measure(load_clip(write_track(tmp_path, first_frame))).remarks
    said = [line for line in remarks if "first_frame: null" in line]
    assert bool(said) == is_said
    assert not is_said or "object1 rests for 0.4 s from frame 0 on" in said[0]


@pytest.mark.parametrize("first_frame, is_found", [(None, True), ("0", False), ("null", True)])
def test_a_table_of_others_begins_anywhere(
    first_frame: str | None, is_found: bool, tmp_path: Path
) -> None:
    """Nobody says that it is let go in its first row, unless somebody writes it."""
    path = write_track(tmp_path, "0")
    rows = (tmp_path / "held.csv").read_text().splitlines()[1:]
    table = "\n".join(["t (s),x (m),y (m)", *(row.rpartition(",")[0] for row in rows)])
    (tmp_path / "held.csv").write_text(table + "\n")
    said = "" if first_frame is None else f", first_frame: {first_frame}"
    path.write_text(YAML.replace(", first_frame: FRAME", said) + "track_y: up\n")
    measured = measure(load_clip(path))
    release_s, _ = build_scene(measured.clip, measured.observation).surroundings.release_s
    assert release_s == pytest.approx(HELD_S if is_found else 0.0, abs=0.04)


def test_what_moves_in_the_first_row_of_a_table_of_others_starts_moving(tmp_path: Path) -> None:
    path = write_track(tmp_path, "0")
    rows = (tmp_path / "held.csv").read_text().splitlines()[20:]  # on its way
    table = "\n".join(["t (s),x (m),y (m)", *(row.rpartition(",")[0] for row in rows)])
    (tmp_path / "held.csv").write_text(table + "\n")
    path.write_text(YAML.replace(", first_frame: FRAME", "") + "track_y: up\n")
    measured = measure(load_clip(path))
    assert measured.clip.starts_moving
    assert any("its speed there is inferred" in line for line in measured.remarks)


def test_what_falls_out_of_sight_was_let_go_before(tmp_path: Path) -> None:
    times = np.delete(np.arange(36) / 60, slice(14, 23))
    height = 1.8 - 4.905 * np.maximum(times - 0.08, 0) ** 2
    rows = [f"{t:.4f},{y:.4f}" for t, y in zip(times, height, strict=True)]
    (tmp_path / "gap.csv").write_text("\n".join(["t (s),y (m)", *rows]) + "\n")
    (tmp_path / "gap.yaml").write_text(
        "track: gap.csv\nscenario: fall\nobjects: [{name: ball, shape: sphere}]\n"
    )
    measured = measure(load_clip(tmp_path / "gap.yaml"))
    release_s, sd_s = build_scene(measured.clip, measured.observation).surroundings.release_s
    assert abs(release_s - 0.08) < sd_s
