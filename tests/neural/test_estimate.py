"""The network that ships with the package, on tracks and clips that it has not seen."""

import dataclasses
import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy import stats

from galileo_jax.assembly.build_problem import make_joint_problem
from galileo_jax.clip.schema import Clip, ClipObject
from galileo_jax.inference.joint_problem import JointProblem
from galileo_jax.inference.posterior import Posterior
from galileo_jax.model.model import FRICTION_PRIOR, MASS_PRIOR
from galileo_jax.neural import galileo_task
from galileo_jax.neural.estimate import TRAINED, cnn_posterior, trained_network
from galileo_jax.neural.world import IDEAL_FRICTION
from galileo_jax.observation.observation import Observation
from galileo_jax.runtime.errors import InputError
from galileo_jax.similarity.discrepancy import SCALE_SD
from galileo_jax.similarity.gaussian_likelihood import NoiseModel
from tests.ramp_model import HIT
from tests.reference_ramp import Experiment, solve

NOISE_M = 3e-5
LARGEST_FILE = 4e6  # bytes


def trials_of(
    experiment: Experiment,
    fps: float = 30.0,
    frames: int = 90,
    noise: NoiseModel = "bodies",
    **declared: Any,
) -> JointProblem:
    times = np.arange(frames) / fps
    exact = solve(experiment, times).position_m
    count = len(exact)
    errors = NOISE_M * np.random.default_rng(0).standard_normal(exact.shape)
    names = ("object1", "object2")[:count]
    observation = Observation(
        names=names,
        times_s=times,
        position_m=exact + errors,
        covariance_m2=np.broadcast_to(
            NOISE_M**2 * np.eye(2)[None, ..., None], (count, 2, 2, frames)
        ).copy(),
        mask=np.ones((count, frames), bool),
    )
    objects = tuple(
        ClipObject(name=name, shape="box", size_m=(length, 0.06, height))
        for name, (length, height) in zip(names, experiment.size_m, strict=False)
    )
    clip = Clip(
        path=Path("made.yaml"),
        track=Path("made.csv"),
        scenario="ramp",
        fps=fps,
        ramp_angle_deg=float(np.rad2deg(experiment.angle_rad)),
        objects=objects,
        frame_count=frames,
        **declared,
    )
    return make_joint_problem([clip], [observation], noise=noise)


def phi(posterior: Posterior) -> np.ndarray:
    m1, m2 = posterior["m1"], posterior["m2"]
    return (m1 - m2) / (m1 + m2)


@pytest.mark.parametrize(
    ("experiment", "fps"),
    [
        (HIT, 30.0),
        (HIT, 60.0),
        (dataclasses.replace(HIT, friction=(0.2, 0.1), mass_kg=(0.3, 0.4)), 30.0),
        (dataclasses.replace(HIT, angle_rad=np.deg2rad(12), friction=(0.06, 0.2)), 30.0),
    ],
)
def test_one_network_serves_clips_of_all_kinds(experiment, fps, x64):
    posterior, _, notes = cnn_posterior(trials_of(experiment, fps), seed=0)
    k1, k2 = experiment.friction
    m1, m2 = experiment.mass_kg
    for drawn, true, close in (
        (posterior["k1"], k1, 0.005),
        (posterior["k2"], k2, 0.02),
        (phi(posterior), (m1 - m2) / (m1 + m2), 0.05),
    ):
        assert abs(drawn.mean() - true) < close
        low, high = np.quantile(drawn, [0.001, 0.999])
        assert low < true < high
    assert posterior.is_converged and "warnings" not in notes


def test_same_seed_same_draws_and_masses_make_the_ratio(x64):
    trials = trials_of(HIT)
    first, second = (cnn_posterior(trials, seed=3)[0] for _ in range(2))
    assert np.array_equal(first.draws, second.draws)
    # Only the ratio shows: each mass alone stays as unknown as before.
    assert np.std(np.log(first["m1"])) > 0.4


def test_angle_and_scale_known_within_so_much_widen_the_frictions(x64):
    exact, _, _ = cnn_posterior(trials_of(HIT), seed=0)
    sds: dict[str, Any] = {
        "ramp_angle_sd_deg": 0.5,
        "pixels_per_metre": 500.0,
        "pixels_per_metre_sd": 10.0,
    }
    posterior, _, _ = cnn_posterior(trials_of(HIT, **sds), seed=0)
    k1, _ = HIT.friction
    slope = np.tan(HIT.angle_rad)
    added = np.hypot((1 + k1 * slope) * np.deg2rad(0.5), (slope - k1) * 0.02)
    assert posterior["k1"].std() == pytest.approx(np.hypot(exact["k1"].std(), added), rel=0.05)
    with_angle = np.corrcoef(posterior["k1"].ravel(), posterior["declared_angle"].ravel())[0, 1]
    assert with_angle > 0.5
    assert np.corrcoef(posterior["k2"].ravel(), posterior["declared_scale"].ravel())[0, 1] < -0.2


def test_what_a_camera_does_to_a_track_widens_the_answer(x64):
    """And a scale of which nobody says how well it is known, as `SCALE_SD` does."""
    track, _, _ = cnn_posterior(trials_of(HIT), seed=0)
    exact = trials_of(HIT, noise="camera", pixels_per_metre=500.0, pixels_per_metre_sd=0.0)
    video, _, _ = cnn_posterior(exact, seed=0)
    assert video["k1"].std() > 1.2 * track["k1"].std()
    unsaid, _, _ = cnn_posterior(trials_of(HIT, noise="camera", pixels_per_metre=500.0), seed=0)
    added = (np.tan(HIT.angle_rad) - HIT.friction[0]) * SCALE_SD
    expected = np.hypot(video["k1"].std(), added)
    assert unsaid["k1"].std() == pytest.approx(expected, rel=0.05)


def test_what_a_clip_cannot_tell_stays_open(x64):
    far = dataclasses.replace(HIT, object2_x_m=1.5)
    posterior, _, _ = cnn_posterior(trials_of(far), seed=0)
    assert abs(posterior["k1"].mean() - 0.1) < 0.005
    assert np.std(posterior["k2"]) > 0.25
    assert np.std(np.log(posterior["m1"] / posterior["m2"])) > 0.8
    stands, _, _ = cnn_posterior(trials_of(dataclasses.replace(HIT, friction=(0.6, 0.2))), seed=0)
    assert stands["k1"].min() > np.tan(HIT.angle_rad) and stands["k1"].max() > 0.95


def test_a_single_object_is_enough_for_its_friction(x64):
    alone = dataclasses.replace(HIT, object2_x_m=None)
    posterior, _, _ = cnn_posterior(trials_of(alone), seed=0)
    assert "k2" not in posterior.names
    assert abs(posterior["k1"].mean() - 0.1) < 0.005


@pytest.mark.parametrize(
    ("changes", "fps", "complaint"),
    [
        ({"angle_rad": np.deg2rad(45)}, 30.0, "the ramp's angle out of their range"),
        ({"release_m": 2.0}, 30.0, "the way to the foot"),
        ({}, 10.0, "the frame rate"),
        ({"size_m": ((0.25, 0.25), (0.06, 0.06)), "object2_x_m": 0.5}, 30.0, "length"),
    ],
)
def test_a_clip_unlike_the_training_clips_is_told(changes, fps, complaint, x64):
    strange = dataclasses.replace(HIT, **changes)
    posterior, _, notes = cnn_posterior(trials_of(strange, fps), seed=0)
    assert not posterior.is_converged
    (warning,) = notes["warnings"]
    assert "unlike those that the network was trained on" in warning
    assert complaint in warning


def test_a_force_that_grows_on_the_way_is_told(x64):
    trials = trials_of(HIT)
    (problem,) = trials.problems
    seen = problem.observation
    # As drag does: 2 cm less after the first half second, growing with its cube.
    less = 0.02 * (seen.times_s / 0.5) ** 3 * np.array([[np.cos(0.35)], [-np.sin(0.35)]])
    position = seen.position_m.copy()
    position[0] -= np.where(seen.position_m[0, :1] < 0, less, 0.0)
    dragged = dataclasses.replace(seen, position_m=position)
    posterior, _, notes = cnn_posterior(
        JointProblem((dataclasses.replace(problem, observation=dragged),)), seed=0
    )
    assert not posterior.is_converged
    assert "not evenly accelerated" in notes["warnings"][0]


def test_other_models_are_refused(x64):
    trials = trials_of(HIT)
    with pytest.raises(InputError, match="one clip expected"):
        cnn_posterior(JointProblem(trials.problems * 2), seed=0)


def test_the_packages_network_is_small_and_of_the_right_preset():
    assert TRAINED.stat().st_size < LARGEST_FILE
    trained_network()


@pytest.mark.slow
@pytest.mark.video
def test_shared_clips_k1(shared_data, tmp_path):
    from galileo_jax.commands import command, fit

    errors = []
    for truth_path in sorted((shared_data / "ramp").glob("plain_coulomb_none_[0-2].truth.json")):
        name = truth_path.name.removesuffix(".truth.json")
        clip = truth_path.with_name(f"{name}.yaml")
        argv = [str(clip), "--method", "cnn", "--out", str(tmp_path / name)]
        assert command.run(fit.main, argv) == 0
        result = json.loads((tmp_path / name / "result.json").read_text())
        assert result["method"] == "cnn" and (tmp_path / name / "posterior.nc").is_file()
        errors.append(
            abs(result["parameters"]["k1"]["mean"] - json.loads(truth_path.read_text())["k1"])
        )
    assert np.median(errors) < 0.01


def test_where_nothing_tells_the_ideal_world_answers_with_its_own_prior():
    t = galileo_task._of_ideal_prior(np.random.default_rng(0), (1, 4000))
    k2 = FRICTION_PRIOR.low + (FRICTION_PRIOR.high - FRICTION_PRIOR.low) * stats.norm.cdf(t[..., 1])
    assert stats.kstest(k2.ravel(), stats.uniform(*IDEAL_FRICTION).cdf).pvalue > 0.01
    ratio = np.exp(np.sqrt(2) * MASS_PRIOR.sd * t[..., 0])
    assert np.mean(ratio < 0.5) == pytest.approx(0.25, abs=0.03)  # of two uniform masses
