"""What a person types for a file, counted."""

from pathlib import Path

import pytest

from benchmarks.people import num_typed

OBJECTS = {"objects": [{"name": "block", "shape": "box"}]}


@pytest.mark.parametrize(
    ("declared", "count"),
    [
        ({"scenario": "incline", "track_units": "m", "ramp_angle_deg": 31.0}, 1),  # the angle
        ({"scenario": "incline", "track_units": "cm", "ramp_angle_deg": 31.0}, 2),
        ({"scenario": "spring", "track_units": "m"}, 1),  # no angle is asked for then
    ],
)
def test_an_answer_counts_unless_enter_gives_it(declared, count, tmp_path: Path) -> None:
    rows = "\n".join(f"{n / 30:.4f},{0.6 * (n / 30) ** 2:.4f}" for n in range(20))
    (tmp_path / "way.csv").write_text(f"t (s),s\n{rows}\n")
    case = {"track": "way.csv", **declared, **OBJECTS}
    assert num_typed(tmp_path, "real/way.yaml", case) == count
    assert num_typed(tmp_path, "tables/way.yaml", case) is None  # no person made it
