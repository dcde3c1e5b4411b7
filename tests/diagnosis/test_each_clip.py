"""What is said of clips that do not fit together."""

import numpy as np
import pytest

from galileo_jax.assembly.build_problem import make_joint_problem
from galileo_jax.clip.load import load_clip
from galileo_jax.clip.track_csv import read_observation_csv
from galileo_jax.comparison.compare import compare
from galileo_jax.diagnosis.each_clip import EachClip, each_clip, kind_of
from galileo_jax.inference.fits.gradient import GradientFitter
from galileo_jax.report.diagnosis_text import each_clip as told
from galileo_jax.search.fit import best_fit

G, ANGLE, FPS, NOISE_M = 9.81, np.radians(22.0), 60, 3e-4


def one(p: float, extra: tuple[float, ...]) -> EachClip:
    sd = np.full(4, 0.01)
    return EachClip("run", 1.0, 1.0, p, np.linspace(0, 1, 5), np.array(extra), sd)


@pytest.mark.parametrize(
    ("found", "kind"),
    [
        ((one(0.5, (0.1, 0.1, 0.1, 0.1)), one(0.5, (-0.1, -0.1, -0.1, -0.1))), "shared"),
        ((one(0.5, (0.0, 0.0, 0.0, 0.0)), one(1e-9, (0.1, 0.0, 0.0, -0.1))), "some"),
        ((one(1e-9, (0.1, 0.0, 0.0, -0.1)), one(1e-9, (0.11, 0.0, 0.0, -0.1))), "alike"),
        ((one(1e-9, (0.1, 0.0, 0.0, -0.1)), one(1e-9, (-0.1, 0.0, 0.0, 0.1))), "different"),
    ],
)
def test_kinds(found, kind):
    assert kind_of(found) == kind


def write_slide(folder, name: str, friction: tuple[float, float], seed: int):
    """A slide of 0.8 m whose friction changes in the middle; returns the csv."""
    before, after = (G * (np.sin(ANGLE) - k * np.cos(ANGLE)) for k in friction)
    half_s = np.sqrt(0.8 / before)
    time_s = np.arange(0.0, 2.0, 1 / FPS)
    late = np.clip(time_s - half_s, 0.0, None)
    early = np.minimum(time_s, half_s)
    way = before * early**2 / 2 + before * half_s * late + after * late**2 / 2
    time_s, way = time_s[way < 0.8], way[way < 0.8]
    sin, cos = np.sin(ANGLE), np.cos(ANGLE)
    start = np.array([[-0.9 * cos + 0.02 * sin], [0.9 * sin + 0.02 * cos]])
    place = start + way * np.array([[cos], [-sin]])
    place = place + NOISE_M * np.random.default_rng(seed).standard_normal(place.shape)
    rows = [f"{t:.9f},{x:.9f},{y:.9f},{NOISE_M}" for t, x, y in zip(time_s, *place, strict=True)]
    head = "time_s,object1_x_m,object1_y_m,object1_sd_m"
    path = folder / f"{name}.csv"
    path.write_text("\n".join([head, *rows]) + "\n")
    path.with_suffix(".yaml").write_text(
        f"track: {name}.csv\nscenario: incline\nramp_angle_deg: 22.0\nobjects:\n"
        "  - {name: object1, shape: box, size_m: [0.04, 0.04, 0.04]}\n"
    )
    return path


@pytest.mark.slow
def test_the_clip_that_differs_is_told_and_how(tmp_path):
    """Friction is 0.1 less in the second half of one of two slides."""
    paths = [
        write_slide(tmp_path, "even", (0.3, 0.3), 0),
        write_slide(tmp_path, "smoother", (0.3, 0.2), 1),
    ]
    clips = [load_clip(path) for path in paths]
    trials = make_joint_problem(clips, [read_observation_csv(path) for path in paths])
    fit = best_fit(GradientFitter(trials), 0, effects=())
    comparison = compare(trials, fit, 0)
    assert not comparison.is_adequate
    found = each_clip(trials, fit, comparison)
    assert kind_of(found) == "some"
    assert found[0].p_alone > 0.01 > 1e-6 > found[1].p_alone
    # Against the model of both: what changes half way is known whatever that model is.
    step = found[1].extra_m_s2[2:].mean() - found[1].extra_m_s2[:2].mean()
    assert step == pytest.approx(0.1 * G * np.cos(ANGLE), abs=0.1)
    steady = found[0].extra_m_s2[2:].mean() - found[0].extra_m_s2[:2].mean()
    assert steady == pytest.approx(0.0, abs=0.1)


def test_it_is_said_in_words():
    clip = {
        "clip": "run",
        "chi2_together": 3.0,
        "chi2_alone": 1.0,
        "p_alone": 0.5,
        "extra_acceleration_m_s2": [0.1, -0.2],
        "sd_m_s2": [0.01, 0.02],
    }
    first, second = told({"kind": "shared", "clips": [clip]})
    assert first.startswith("clips: each clip alone agrees with the model")
    assert "+0.100 +- 0.010, -0.200 +- 0.020 m/s^2" in second
