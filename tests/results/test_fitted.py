"""The fitted positions of an export lie on the points that were followed."""

import json

import numpy as np
import pandas as pd
import pytest

import galileo_jax as gx
from galileo_jax.commands import command, fit


@pytest.fixture
def clip(tmp_path):
    """A slide whose first row is 8 mm off, as its error says; the place where it starts is not."""
    t = np.arange(40) / 40
    way, sd = 1.1 * t**2, np.full(40, 5e-4)
    noise = 5e-4 * np.random.default_rng(1).standard_normal((2, 40))
    noise[:, 0], sd[0] = 8e-3, 5e-3
    x, y = np.outer([np.cos(0.4), -np.sin(0.4)], way) + noise
    rows = [f"{a},{b},{c},{d}" for a, b, c, d in zip(t, x, y, sd, strict=True)]
    path = tmp_path / "slide.csv"
    path.write_text("\n".join(["time_s,object1_x_m,object1_y_m,object1_sd_m", *rows]) + "\n")
    path.with_suffix(".yaml").write_text(
        "track: slide.csv\nscenario: incline\nramp_angle_deg: 22.918\nstarts_moving: false\n"
        "objects: [{name: object1, shape: box}]\n"
    )
    return path


def test_the_fitted_positions_have_no_offset(clip, tmp_path):
    gx.fit(clip).save(tmp_path / "run")
    gx.export(tmp_path / "run", to="csv", fitted=True)
    track = pd.read_csv(tmp_path / "run" / "export" / "track.csv")
    for axis in "xy":
        left = (track[f"{axis}_m"] - track[f"fitted_{axis}_m"]).to_numpy()[1:]
        assert abs(left.mean()) < 3e-4
        assert left.std() == pytest.approx(5e-4, rel=0.3)


def test_how_near_the_fit_comes_is_said(clip, tmp_path, capsys):
    out = tmp_path / "run"
    assert command.run(fit.main, [str(clip), "--out", str(out)]) == 0
    error = json.loads((out / "result.json").read_text())["error"]
    rows = np.sqrt((2 * 39 * 5e-4**2 + 2 * 8e-3**2) / 40)
    assert error["rms_mm"] == pytest.approx(1e3 * rows, rel=0.15)
    assert error["rms_percent_of_way"] == pytest.approx(100 * rows / 1.05, rel=0.15)
    assert (error["frames_used"], error["frames"]) == (40, 40)
    assert "% of the way off (root mean square), in 40 of 40 frames" in capsys.readouterr().out
    assert "in 40 of 40 frames" in (out / "report.html").read_text()


def test_too_few_frames_are_no_verdict(clip, tmp_path, capsys):
    lines = clip.read_text().splitlines()
    kept = [f"{row.split(',')[0]},,," if 6 < i < 36 else row for i, row in enumerate(lines)]
    clip.write_text("\n".join(kept) + "\n")
    assert command.run(fit.main, [str(clip), "--out", str(tmp_path / "run")]) == 0
    said = capsys.readouterr().out
    assert "no verdict: only 11 of 40 frames are used" in said and "See where" not in said
    check = gx.compare(tmp_path / "run")
    assert check.document["adequate"] is None
    assert "only 11 of 40 frames" in check.document["no_verdict"]
    with pytest.raises(gx.InputError, match="no verdict: only 11 of 40 frames"):
        gx.diagnose(clip)
