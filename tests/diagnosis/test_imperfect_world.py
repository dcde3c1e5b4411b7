"""Boards whose friction varies along the way, moved by an integrator of this test's own."""

import numpy as np
import pytest

import galileo_jax as gx
from galileo_jax.api.clips import load
from galileo_jax.assembly.build_problem import with_library
from galileo_jax.diagnosis.diagnosis import Candidate
from galileo_jax.diagnosis.imperfect_world import imperfect_world
from galileo_jax.diagnosis.judge import Judge
from galileo_jax.diagnosis.stakes import VerdictStakes
from galileo_jax.inference.fits.gradient import GradientFitter
from galileo_jax.measurement.measure import measure
from galileo_jax.report.diagnosis_text import roughness
from galileo_jax.search.fit import best_fit
from galileo_jax.search.hypothesis import Hypothesis

ANGLE_DEG, FRICTION, LENGTH_M = 25.0, 0.25, 0.01
FPS, SUBSTEPS, NOISE_M, WAY_M = 100.0, 50, 1e-4, 0.9
DRAG_PER_M = 0.0064  # of the air on a baseball
YAML = """
track: slide.csv
scenario: incline
ramp_angle_deg: {angle}
objects: [{{name: object1, shape: box, mass_kg: 0.2}}]
"""


def drawn(folder, uneven, drag_per_m=0.0, seed=3):
    """A slide down a board: friction by Ornstein and Uhlenbeck along the way, air drag c v|v|.

    Returns:
      The clip, and the mean friction of this board.
    """
    rng = np.random.default_rng(seed)
    grid = np.arange(0.0, WAY_M + 0.1, LENGTH_M / 20)
    keep = np.exp(-1 / 20)
    excess = [rng.standard_normal()]
    for shock in rng.standard_normal(len(grid) - 1):
        excess.append(keep * excess[-1] + np.sqrt(1 - keep**2) * shock)
    friction = FRICTION + uneven * np.array(excess)
    angle, dt = np.radians(ANGLE_DEG), 1 / (FPS * SUBSTEPS)
    place, speed, seen = 0.0, 0.0, []
    while place < WAY_M:
        seen.append(place)
        for _ in range(SUBSTEPS):
            k = np.interp(place, grid, friction)
            pull = 9.81 * (np.sin(angle) - k * np.cos(angle)) - drag_per_m * speed * abs(speed)
            speed = max(speed + pull * dt, 0.0)
            place += speed * dt
    way = np.array(seen)
    x, y = way * np.cos(angle), -way * np.sin(angle)
    rows = np.column_stack([np.arange(len(way)) / FPS, x, y])
    rows[:, 1:] += NOISE_M * rng.standard_normal((len(way), 2))
    head = "time_s,object1_x_m,object1_y_m"
    np.savetxt(folder / "slide.csv", rows, delimiter=",", header=head, comments="", fmt="%.6f")
    (folder / "slide.yaml").write_text(YAML.format(angle=ANGLE_DEG))
    return folder / "slide.yaml", float(friction[grid < WAY_M].mean())


@pytest.mark.slow
def test_friction_that_varies_much_is_uneven(tmp_path):
    """Ten times as much as on usual boards: the verdict has its name and about its size."""
    clip, friction = drawn(tmp_path, uneven=0.1)
    found = gx.diagnose(clip, seed=0)
    assert (found.verdict.status, found.verdict.effects) == ("named", ("uneven_friction",))
    assert 0.05 < roughness(found.found.rounds[-1].hypothesis) < 0.2
    before, after = found.document["history"]
    assert after["effects"] == ["uneven_friction"]
    assert after["rmse"] < before["rmse"] and after["chi2_per_dof"] < 2 < before["chi2_per_dof"]
    entry = found.best.parameters["k1"]
    assert entry["q025"] < friction < entry["q975"]
    assert "friction coefficient varies by" in found.sentence
    assert not found.document["imperfections"]["friction_roughness"]["ordinary"]


def test_friction_that_varies_as_usual_is_no_effect(tmp_path):
    """The exact model is contradicted all the same; intervals hold the mean friction."""
    clip, friction = drawn(tmp_path, uneven=0.02)
    found = gx.diagnose(clip, seed=0)
    assert found.verdict.status == "none"
    assert found.document["adequate"]
    entry = found.best.parameters["k1"]
    assert entry["q025"] < friction < entry["q975"]


def test_an_effect_beside_uneven_friction_is_named(tmp_path):
    """A drag on a usual board: found beside what the board does."""
    found = gx.diagnose(drawn(tmp_path, uneven=0.02, drag_per_m=1.0)[0], seed=0)
    names = {name for effect in found.verdict.effects for name in effect.split("+")}
    assert found.verdict.status in ("named", "ambiguous")
    assert "air_drag" in names


@pytest.mark.parametrize("uneven", [0.02, 0.1])
def test_a_fit_holds_the_mean_friction(tmp_path, uneven):
    """As is said: usual or more than usual."""
    clip, friction = drawn(tmp_path, uneven)
    fit = gx.fit(clip, seed=0)
    entry = fit.parameters["k1"]
    assert entry["q025"] < friction < entry["q975"]
    assert fit.result["probability_imperfect"] > 0.95
    assert fit.result["imperfections"]["friction_roughness"]["ordinary"] == (uneven < 0.05)


def thrown(folder, scale_error, slow_m, seed):
    """Fifteen places of a throw with slow errors, read off with a scale that is wrong."""
    rng = np.random.default_rng(seed)
    t = np.arange(15) / 15
    apart = (t[:, None] - t) / 0.12
    slow = slow_m * np.linalg.cholesky(np.exp(-(apart**2) / 2) + 1e-6 * np.eye(len(t)))
    rows = [t]
    for place in (1.6 * t, 4.6 * t - 4.905 * t**2):
        errors = slow @ rng.standard_normal(15) + 3e-4 * rng.standard_normal(15)
        rows.append((1 + scale_error) * place + errors)
    head = "t (s),x (m),y (m)"
    table = np.column_stack(rows)
    np.savetxt(folder / "toss.csv", table, delimiter=",", header=head, comments="", fmt="%.4f")
    (folder / "toss.yaml").write_text(
        "track: toss.csv\nscenario: flight\nobjects: [{name: ball, shape: sphere}]\n"
    )
    return folder / "toss.yaml"


@pytest.mark.slow
@pytest.mark.parametrize("seed", [2, 3])
def test_a_wrong_scale_is_missing_though_imperfections_could_explain_it(tmp_path, seed):
    """Of usual sizes, but 30 and 110 times less probable than a scale 3 % off."""
    found = gx.diagnose(thrown(tmp_path, 0.03, 0.001, seed), seed=0)
    assert found.verdict.status == "ambiguous"
    assert set(found.verdict.effects) == {"scale_error", "frame_rate"}
    assert not found.document["adequate"]


@pytest.mark.parametrize("seed", [0, pytest.param(1, marks=pytest.mark.slow)])
def test_slow_errors_alone_are_no_effect(tmp_path, seed):
    assert gx.diagnose(thrown(tmp_path, 0.0, 0.002, seed), seed=0).verdict.status == "none"


def test_an_effect_is_expected_at_its_strength_beside_imperfections(tmp_path):
    """Slow errors look like more drag in an exact world than beside errors."""
    t = np.arange(40) / 15
    rng = np.random.default_rng(0)
    slow = 0.25 * np.linalg.cholesky(
        np.exp(-(((t[:, None] - t) / 0.6) ** 2) / 2) + 1e-6 * np.eye(40)
    )
    fallen = np.log(np.cosh(t * np.sqrt(9.81 * DRAG_PER_M))) / DRAG_PER_M
    height = 35 - fallen + slow @ rng.standard_normal(40) + 0.04 * rng.standard_normal(40)
    head = "t (s),y (m)"
    rows = np.column_stack([t, height])
    np.savetxt(tmp_path / "ball.csv", rows, delimiter=",", header=head, comments="", fmt="%.4f")
    (tmp_path / "ball.yaml").write_text(
        "track: ball.csv\nscenario: fall\n"
        "objects: [{name: ball, shape: sphere, size_m: [0.036], mass_kg: 0.14}]\n"
    )
    seen = measure(load(tmp_path / "ball.yaml"))
    trials = with_library([seen.clip], [seen.observation], "rigid", None)
    fitter = GradientFitter(trials)
    base = Hypothesis((), best_fit(fitter, 0, effects=()))
    own = Hypothesis(("air_drag",), best_fit(fitter, 0, effects=("air_drag",)))
    prior = VerdictStakes(trials, False).log_prior(own)
    exact = Candidate(own.effects, own, {}, 0.0, own.evidence_over(base), prior, 0.5, None, ())
    world = imperfect_world(Judge(trials, 3.0, 0), base)
    assert world is not None
    (found,) = world.with_candidates([exact]).table
    stakes = VerdictStakes(found.hypothesis.of(trials), False)
    assert found.log_prior == pytest.approx(stakes.log_prior(found.hypothesis))
    assert abs(found.log_prior - exact.log_prior) > 0.1
