"""Sizes from the paths: heights above the surfaces, and the distance at which objects meet."""

import math
from pathlib import Path

import numpy as np
import pytest

from galileo_jax.clip.load import load_clip
from galileo_jax.measurement.measure import measure
from galileo_jax.runtime.errors import InputError

ANGLE = math.radians(20.0)
LENGTHS, HEIGHTS = (0.066, 0.058), (0.079, 0.073)
NOISE_M = 5e-4


def write_track(
    folder: Path,
    sizes: tuple[str, str],
    restitution: float = 0.0,
    moves: bool = True,
    noise_m: float = NOISE_M,
) -> Path:
    """Box 1 comes down, crosses the foot and hits box 2, 0.25 m further on; they go on evenly."""
    times = np.arange(60) / 30
    along = -0.4 + 0.5 * 2.2 * times**2
    speed, at_foot = math.sqrt(2 * 2.2 * 0.4), math.sqrt(2 * 0.4 / 2.2)
    on_table = np.clip(speed * (times - at_foot), 0, None)
    gap = 0.25 - sum(LENGTHS) / 2
    hit = at_foot + gap / speed
    after = np.clip(times - hit, 0, None)
    first_speed, second_speed = speed * (1 - restitution) / 2, speed * (1 + restitution) / 2
    on_table = np.where(times > hit, gap + first_speed * after, on_table)
    is_down = times > at_foot
    half = HEIGHTS[0] / 2
    x1 = np.where(is_down, on_table, along * math.cos(ANGLE) + half * math.sin(ANGLE))
    y1 = np.where(is_down, half, -along * math.sin(ANGLE) + half * math.cos(ANGLE))
    x2, y2 = 0.25 + second_speed * after, np.full(60, HEIGHTS[1] / 2)
    points = np.array([x1, y1, x2, y2])
    if not moves:
        points[:] = points[:, :1]
    points += np.random.default_rng(4).normal(0, noise_m, points.shape)
    titles = "time_s,object1_x_m,object1_y_m,object1_sd_m,object2_x_m,object2_y_m,object2_sd_m"
    rows = [
        f"{t:.6f},{a:.6f},{b:.6f},{noise_m},{c:.6f},{d:.6f},{noise_m}"
        for t, (a, b, c, d) in zip(times, points.T, strict=True)
    ]
    (folder / "hit.csv").write_text("\n".join([titles, *rows]) + "\n")
    path = folder / "hit.yaml"
    path.write_text(
        "track: hit.csv\nscenario: ramp\nramp_angle_deg: 20.0\nobjects:\n"
        + "".join(
            f"  - {{name: object{n + 1}, shape: box, size_m: {size}}}\n"
            for n, size in enumerate(sizes)
        )
    )
    return path


@pytest.mark.parametrize("restitution", [0.0, 0.5])
def test_both_unknown(restitution: float, tmp_path: Path) -> None:
    measured = measure(load_clip(write_track(tmp_path, ("null", "null"), restitution)))
    first, second = (item.size_m for item in measured.clip.objects)
    assert first is not None
    assert second is not None
    assert (first[2], second[2]) == pytest.approx(HEIGHTS, abs=1e-3)
    # Which is longer nothing shows: only their sum enters.
    assert first[0] + second[0] == pytest.approx(sum(LENGTHS), abs=4e-3)
    assert measured.inferred["object1.size_m"]["mean"] == list(first)
    lines = measured.remarks
    assert [line.split(": size_m")[0].rsplit(" ", 1)[1] for line in lines] == ["object1", "object2"]


def test_one_unknown(tmp_path: Path) -> None:
    measured = measure(load_clip(write_track(tmp_path, ("[0.066, 0.05, 0.079]", "null"))))
    first, second = (item.size_m for item in measured.clip.objects)
    assert first == (0.066, 0.05, 0.079)
    assert second is not None
    assert second[0] == pytest.approx(LENGTHS[1], abs=4e-3)
    assert list(measured.inferred) == ["object2.size_m"]


def test_without_a_hit_the_length_is_the_height(tmp_path: Path) -> None:
    measured = measure(load_clip(write_track(tmp_path, ("null", "null"), moves=False)))
    sizes = [item.size_m for item in measured.clip.objects]
    assert [size[2] for size in sizes if size] == pytest.approx(HEIGHTS, abs=1e-3)
    assert all(size and size[0] == size[2] for size in sizes)


def test_known_sizes_are_left_alone(tmp_path: Path) -> None:
    sizes = ("[0.066, 0.05, 0.079]", "[0.058, 0.05, 0.073]")
    measured = measure(load_clip(write_track(tmp_path, sizes)))
    assert not measured.inferred and not measured.remarks


def test_two_that_pass_through_each_other_have_no_size(tmp_path: Path) -> None:
    """As where the tracker changed one for the other."""
    path = write_track(tmp_path, ("null", "null"))
    table = tmp_path / "hit.csv"
    title, *rows = (line.split(",") for line in table.read_text().splitlines())
    at = title.index("object2_x_m")
    for row in rows:
        row[at] = f"{float(row[at]) - sum(LENGTHS) / 2 - 0.002:.6f}"
    table.write_text("\n".join(map(",".join, [title, *rows])) + "\n")
    with pytest.raises(InputError, match=r"size_m: null of object1 or object2.*do not show it: at"):
        measure(load_clip(path))


def test_what_stirs_before_the_hit_was_not_hit_then(tmp_path: Path) -> None:
    """A shadow, or a coder, shifts what rests by more than its errors."""
    path = write_track(tmp_path, ("null", "null"), noise_m=2e-5)
    table = tmp_path / "hit.csv"
    title, first, *rows = table.read_text().splitlines()
    stirs = 2.5e-4 * np.linspace(0, 1, 12) ** 2  # all rest meanwhile
    rest = [first.split(",") for _ in stirs]
    for number, (row, by) in enumerate(zip(rest, stirs, strict=True)):
        row[0], row[4] = f"{(number - len(rest)) / 30:.6f}", f"{float(row[4]) + by:.6f}"
    moved = [first.split(","), *(row.split(",") for row in rows)]
    for row in moved:
        row[4] = f"{float(row[4]) + stirs[-1]:.6f}"
    table.write_text("\n".join([title, *map(",".join, [*rest, *moved])]) + "\n")
    first, second = (item.size_m for item in measure(load_clip(path)).clip.objects)
    assert first is not None and second is not None
    assert first[0] / 2 + second[0] / 2 == pytest.approx(sum(LENGTHS) / 2, abs=0.01)
