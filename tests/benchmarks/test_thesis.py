"""The thesis's experiments: what they share, and one of them from the call to the figure."""

import importlib
import json
import sys
from pathlib import Path

import numpy as np
import pytest

SCRIPTS = Path(__file__).resolve().parents[2] / "benchmarks" / "thesis"
NAMES = sorted(path.stem for path in SCRIPTS.glob("*.py") if path.stem != "setting")


@pytest.fixture
def script(monkeypatch, x64):
    """Imports a script as it would be called."""
    monkeypatch.syspath_prepend(SCRIPTS)
    yield importlib.import_module
    for name in ("setting", *NAMES):
        sys.modules.pop(name, None)


def test_object_2_moves_and_distances_are_zero_at_the_truth_alone(script):
    setting = script("setting")
    clean, noisy = (setting.experiments(3, 2, 60, noise_m) for noise_m in (0.0, setting.NOISE_M))
    assert np.array_equal(clean[0].theta, noisy[0].theta)
    for case in clean:
        assert np.ptp(case.clean_m[1, 0]) > setting.SEEN_M
        assert (case.theta < [1, 0.3, 1, 0.3]).all() and (case.theta > 0).all()
    assert setting.distances(clean[0].theta, clean[0]) == pytest.approx((0, 0), abs=1e-12)
    l1, l2 = setting.distances(noisy[0].theta, noisy[0])
    # 240 numbers of 0.01 m/s, 30 of them a second.
    sd = setting.NOISE_M_S / 30
    assert l1 == pytest.approx(240 * sd * np.sqrt(2 / np.pi), rel=0.2)
    assert l2 == pytest.approx(np.sqrt(240) * sd, rel=0.2)
    far = setting.distances(setting.guesses(0), noisy[0])
    assert far[0] > 3 * l1 and far[1] > 3 * l2


def test_a_coin_sees_no_data(script):
    walks = script("coin_toss").coin_walks(np.random.default_rng(0))
    assert walks.shape == (16, 76, 4) and (walks > 0).all() and (walks < 1).all()
    assert np.allclose(walks.mean((0, 1)), 0.5, atol=0.12)


@pytest.mark.slow
def test_a_script_leaves_figure_table_and_json(script, tmp_path, capsys):
    main = script("parameter_influence").main
    assert main(["--num", "3", "--out", str(tmp_path)]) is None
    *table, last = capsys.readouterr().out.splitlines()
    found = json.loads(last)
    assert found["benchmark"] == "thesis/parameter_influence"
    # The masses with their ratio kept: nothing changes.
    assert max(found["m1 = m2"]["dv_m_s"]) < 1e-6 < min(found["m1"]["dv_m_s"])
    assert (tmp_path / "parameter_influence.png").stat().st_size > 10_000
    assert any(line.startswith("k2") for line in table)


@pytest.mark.parametrize("name", NAMES)
def test_every_script_says_how_it_is_called(name):
    text = (SCRIPTS / f"{name}.py").read_text(encoding="utf-8")
    assert f"`python benchmarks/thesis/{name}.py`" in text
