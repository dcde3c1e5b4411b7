"""A table for each body, joined by time; several motions that follow each other in one table."""

from pathlib import Path

import numpy as np
import pytest

from galileo_jax.clip.load import load_clip
from galileo_jax.clip.look import seen_in_table
from galileo_jax.measurement.measure import observed
from galileo_jax.runtime.errors import InputError
from galileo_jax.table.read import read_table

T = np.arange(30) / 60
PLACES = (np.array([0.8 * T, 0.1 - 0.3 * T]), np.array([1.0 - 0.2 * T, 0.1 + 0.2 * T]))
NOISE_M = 1e-4
PUCK = "shape: cylinder, size_m: [0.03, 0.01]"


def write(
    path: Path, times: np.ndarray, place: np.ndarray, titles: str = "t (s),x (m),y (m)"
) -> None:
    noise = NOISE_M * np.random.default_rng(1).standard_normal(place.shape)
    rows = [f"{t:.6f},{x:.6f},{y:.6f}" for t, x, y in zip(times, *(place + noise), strict=True)]
    path.write_text("\n".join([titles, *rows]) + "\n")


def pucks(folder: Path, more: str = "") -> Path:
    path = folder / "pucks.yaml"
    path.write_text(
        f"track: one.csv\nscenario: from_above\n{more}objects:\n"
        f"  - {{name: one, {PUCK}}}\n  - {{name: two, {PUCK}, track_file: two.csv}}\n"
    )
    return path


def test_a_file_for_each_body_is_joined_by_time(tmp_path: Path) -> None:
    write(tmp_path / "one.csv", T[:25], PLACES[0][:, :25])
    write(tmp_path / "two.csv", T[5:] + 4e-6, PLACES[1][:, 5:])  # another rounding of the clock
    seen, _ = observed(load_clip(pucks(tmp_path)))
    np.testing.assert_array_equal(seen.mask[0], np.arange(30) < 25)
    np.testing.assert_array_equal(seen.mask[1], np.arange(30) >= 5)
    np.testing.assert_allclose(seen.times_s, T, atol=5e-6)
    np.testing.assert_allclose(seen.position_m[1, :2, 5:], PLACES[1][:, 5:], atol=6 * NOISE_M)


def test_files_that_do_not_belong_together_are_refused(tmp_path: Path) -> None:
    write(tmp_path / "one.csv", T, PLACES[0])
    write(tmp_path / "two.csv", T + 100, PLACES[1])
    with pytest.raises(InputError, match=r"two.csv: no time in common with one.csv"):
        load_clip(pucks(tmp_path))
    write(tmp_path / "two.csv", T, PLACES[1], "t (s),x (cm),y (cm)")
    with pytest.raises(InputError, match=r"two.csv: other units of length than one.csv"):
        load_clip(pucks(tmp_path))


def drops(folder: Path, trial: str) -> Path:
    """Three falls from rest that follow each other in one table, each with its clock from 0."""
    times = np.concatenate([T, T[:20], T])
    height = np.concatenate([top - 4.905 * T[:n] ** 2 for top, n in ((2, 30), (3, 20), (4, 30))])
    write(folder / "drops.csv", times, np.array([0 * height, height]))
    path = folder / "drops.yaml"
    path.write_text(
        f"track: drops.csv\nscenario: fall\n{trial}objects: [{{name: ball, shape: sphere}}]\n"
    )
    return path


@pytest.mark.parametrize(("trial", "top", "rows"), [(1, 2.0, 30), (2, 3.0, 20), (3, 4.0, 30)])
def test_one_of_the_motions_in_a_table(trial: int, top: float, rows: int, tmp_path: Path) -> None:
    clip = load_clip(drops(tmp_path, f"trial: {trial}\n"))
    assert any(f"motion {trial} of 3" in line for line in clip.warnings)
    seen, _ = observed(clip)
    assert len(seen.times_s) == rows
    assert seen.position_m[0, 1, 0] == pytest.approx(top, abs=6 * NOISE_M)


def test_which_motion_is_asked_for(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"trial: missing; drops.csv has 3 motions, .* 1, 31, 51;"):
        load_clip(drops(tmp_path, ""))
    with pytest.raises(InputError, match=r"trial: 4, but drops.csv has 3"):
        load_clip(drops(tmp_path, "trial: 4\n"))


def test_one_time_that_is_wrong_is_no_second_motion(tmp_path: Path) -> None:
    times = T.copy()
    times[12] = 0.0
    write(tmp_path / "drops.csv", times, np.array([0 * T, 2 - 4.905 * T**2]))
    (tmp_path / "a.yaml").write_text(
        "track: drops.csv\nscenario: fall\nobjects: [{name: ball, shape: sphere}]\n"
    )
    with pytest.raises(InputError, match=r"row 13.* is not after"):
        load_clip(tmp_path / "a.yaml")


def test_who_sets_out_first_is_proposed_first(tmp_path: Path) -> None:
    rows = [f"{t},{name},{x:.5f},{y:.5f}"
            for t in T
            for name, x, y in (("rests", 1 + max(t - 0.2, 0.0), 0.02),
                               ("slides", 0.9 * t * t, 0.4 - 0.3 * t * t))]  # fmt: skip
    path = tmp_path / "a.csv"
    path.write_text("\n".join(["t (s),id,x (m),y (m)", *rows]) + "\n")
    proposed = seen_in_table(path, read_table(path)).yaml
    assert proposed.index("name: slides") < proposed.index("name: rests")


def test_a_clock_alone_makes_no_csv_of_ours(tmp_path: Path) -> None:
    rows = [f"{t},{800 * t * t:.3f},{-300 * t * t:.3f}" for t in T]
    (tmp_path / "a.csv").write_text("\n".join(["time_s,x_mm,y_mm", *rows]) + "\n")
    (tmp_path / "a.yaml").write_text(
        "track: a.csv\nscenario: incline\nramp_angle_deg: 20\nobjects: [{name: a, shape: box}]\n"
    )
    assert load_clip(tmp_path / "a.yaml").track_units == "mm"
