"""Another trial of the same objects with what was hidden, at other settings."""

import json
import math

import numpy as np
import pytest

import galileo_jax as gx
from galileo_jax.runtime.errors import InputError

SAME = ("m1", "k1", "m2", "k2", "size1_m", "size2_m", "shapes", "effect", "effect_parameters")


@pytest.fixture(scope="module")
def sealed(tmp_path_factory):
    path = tmp_path_factory.mktemp("sealed") / "sealed.csv"
    gx.simulate(path, seed=4, effects=["air_drag", "ramp_angle"], strength=0.5, track_only=True)
    return path.with_suffix(".truth.json")


def test_the_same_objects_at_other_settings(sealed, tmp_path):
    before = json.loads(sealed.read_text())
    made = gx.simulate(
        tmp_path / "again.csv",
        like=sealed,
        release=0.7,
        angle=30.0,
        fps=60.0,
        seed=9,
        track_only=True,
    )
    (truth,) = made.truths
    assert {key: truth[key] for key in SAME} == {key: before[key] for key in SAME}
    assert truth["release_m"] == 0.7 and truth["object2_y_m"] == before["object2_y_m"]
    assert truth["ramp_angle_deg_declared"] == 30.0, "and the error of the angle is the same"
    off = before["ramp_angle_deg_true"] - before["ramp_angle_deg_declared"]
    assert truth["ramp_angle_deg_true"] - 30.0 == pytest.approx(off, abs=1e-6) and off != 0
    x, y = (truth["trajectory"]["object1"][axis][0] for axis in "yz")
    steep, half = math.radians(truth["ramp_angle_deg_true"]), before["size1_m"][2] / 2
    up = y * math.sin(steep) - x * math.cos(steep)
    assert up == pytest.approx(0.7, abs=1e-5)
    assert x * math.sin(steep) + y * math.cos(steep) == pytest.approx(half, abs=1e-5)


def test_at_the_same_settings_it_moves_as_before(sealed, tmp_path):
    before = json.loads(sealed.read_text())
    (truth,) = gx.simulate(tmp_path / "same.csv", like=sealed, seed=8, track_only=True).truths
    for axis in "yz":
        np.testing.assert_allclose(
            truth["trajectory"]["object1"][axis],
            before["trajectory"]["object1"][axis][: truth["frames"]],
            atol=2e-6,
        )


def test_release_alone(tmp_path):
    near, far = (
        gx.simulate(tmp_path / f"{r}.csv", seed=3, release=r, track_only=True).truths[0]
        for r in (0.3, 0.6)
    )
    assert (near["release_m"], far["release_m"]) == (0.3, 0.6)
    assert near["m1"] == far["m1"] and near["size1_m"] == far["size1_m"]


@pytest.mark.parametrize(
    ("options", "complaint"),
    [
        ({"m1": 0.3}, "--m1: is that of --like"),
        ({"effects": ["rolling"]}, "--effect: is that of --like"),
        ({"scenario": "incline"}, "scenario ramp; incline expected"),
        ({"release": 99.0}, "--release: '99' is not a number in"),
    ],
)
def test_what_is_refused(sealed, tmp_path, options, complaint):
    with pytest.raises(InputError, match=complaint):
        gx.simulate(tmp_path / "x.csv", like=sealed, track_only=True, **options)
    assert not (tmp_path / "x.csv").exists()


def test_what_is_no_truth(sealed, tmp_path):
    (tmp_path / "old.truth.json").write_text('{"scenario": "ramp", "objects": 2}')
    for path, complaint in (
        (tmp_path / "none.json", "No such file"),
        (tmp_path / "old.truth.json", "not the truth of a clip that this version simulated"),
    ):
        with pytest.raises(InputError, match=complaint):
            gx.simulate(tmp_path / "x.csv", like=path, track_only=True)
    with pytest.raises(InputError, match=r"--release: drawn for every trial of a --series"):
        gx.simulate(tmp_path / "x.csv", series=2, release=0.4, track_only=True)
