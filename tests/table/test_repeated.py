"""Rows that repeat the one before, as pictures do that are in a film twice, count once."""

from pathlib import Path

import numpy as np
import pytest

from galileo_jax.table.read import read_table

FPS = 60.0


def written(folder: Path, place: np.ndarray, digits: int = 4) -> Path:
    """Places `[axis, row]`, at a steady clock."""
    rows = [[f"{one:.{digits}f}" for one in row] for row in place.T]
    titles = "t (s),x (m),y (m)" if len(place) == 2 else "t (s),y (m)"
    body = [",".join([f"{i / FPS:.4f}", *row]) for i, row in enumerate(rows)]
    path = folder / "track.csv"
    path.write_text("\n".join([titles, *body]) + "\n")
    return path


@pytest.mark.parametrize("copies", [2, 3, 4])
def test_what_is_there_several_times_counts_once(copies: int, tmp_path: Path) -> None:
    """A throw after a rest of a fifth of a second, each place so many times."""
    number = np.arange(60) // copies * copies
    since = np.clip(number / FPS - 0.2, 0, None)
    place = np.stack([1.1 * since, 3.4 * since - 4.905 * since**2])
    place += 5e-4 * np.random.default_rng(1).standard_normal((2, 60))[:, number]
    table = read_table(written(tmp_path, place), None)
    np.testing.assert_allclose(table.clock, np.arange(0, 60, copies) / FPS, atol=1e-4)
    np.testing.assert_allclose(table.position[0], place[:, ::copies], atol=1e-4)
    (said,) = table.warnings
    assert f"each is there {copies} times" in said


@pytest.mark.parametrize("digits", [2, 3, 4])
def test_rest_and_coarse_places_are_no_repeats(digits: int, tmp_path: Path) -> None:
    """A body that goes up, turns, and lies, as exact as it is printed."""
    times = np.arange(60) / FPS
    height = np.clip(3.4 * times - 4.905 * times**2, 0, None)
    table = read_table(written(tmp_path, height[None], digits), None)
    assert len(table.clock) == 60 and not table.warnings


def test_lines_are_those_of_the_file_where_a_time_above_stands_twice(tmp_path: Path) -> None:
    """Two rows at one time, and a place that was copied ten rows below."""
    times = np.arange(30) / FPS
    place = np.stack([1.1 * times, 3.4 * times - 4.905 * times**2])
    place[:, 16] = place[:, 15]
    path = written(tmp_path, place, digits=8)
    head, *rows = path.read_text().splitlines()
    path.write_text("\n".join([head, *rows[:5], *rows[4:]]) + "\n")
    twice, copied = read_table(path, None).warnings
    assert "line 6: 1 times stand in several rows" in twice
    assert f"line {16 + 1 + 2}: the place of the row beside it" in copied
