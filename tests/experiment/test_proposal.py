"""A scene at other settings, and the hypotheses that are taken there."""

import math
from dataclasses import replace

import numpy as np
import pytest

from galileo_jax.api.diagnose import Diagnosis
from galileo_jax.api.next_experiment import next_experiment
from galileo_jax.assembly.build_problem import make_problem
from galileo_jax.clip.load import load_clip
from galileo_jax.clip.track_csv import read_observation_csv
from galileo_jax.experiment.choose import best_first, default_can, expect, with_next
from galileo_jax.experiment.hypothesis_probabilities import beliefs_of, read_beliefs, write_beliefs
from galileo_jax.experiment.predicted_experiment import predict_experiment
from galileo_jax.experiment.proposal import MOST_FRAMES, height_m, propose, release_m
from galileo_jax.experiment.settings import parse_can
from galileo_jax.inference.joint_problem import JointProblem
from galileo_jax.measurement.measure import Measurement, measure
from galileo_jax.runtime.errors import InputError
from tests.found import diagnosis_of, make_trials
from tests.oracle_run import HIT, make_run

RELEASE_M = 0.5  # of HIT


@pytest.fixture(scope="module")
def clip(tmp_path_factory):
    return make_run(tmp_path_factory.mktemp("run"), HIT, 1.6).clip


@pytest.fixture(scope="module")
def trials(tmp_path_factory):
    return make_trials(tmp_path_factory.mktemp("clip"))


@pytest.fixture(scope="module")
def found(trials, clip):
    seen = trials.problems[0].observation
    measured = Measurement(clip, seen, seen)
    made = diagnosis_of(trials, "ambiguous")
    return Diagnosis((measured,), trials, made, {"clips": ["oracle.csv"]}, "galileo diagnose")


def test_what_is_not_set_stays(trials, clip):
    (first,) = trials.problems
    same = propose(clip, trials, 1.0, {"fps": 30.0}).problem
    one, other = first.model.scene.surroundings, same.model.scene.surroundings
    np.testing.assert_allclose(one.start_m, other.start_m, atol=1e-9)
    assert one.half_length_m == other.half_length_m and same.parameters == first.parameters
    sd = np.sqrt(np.median(first.observation.covariance_m2[0, 0, 0]))
    assert np.sqrt(same.observation.covariance_m2[0, 0, 0, 0]) == pytest.approx(sd)
    assert release_m(clip, first) == pytest.approx(RELEASE_M, abs=2e-3)


def test_height_release_and_angle(trials, clip):
    for setting, release in (
        ({"height": 0.1}, 0.1 / math.sin(math.radians(20))),
        ({"height_m": 0.1, "angle_deg": 30.0}, 0.2),
        ({"release": 0.3}, 0.3),
        ({"angle": 30.0}, RELEASE_M),
    ):
        made = propose(clip, trials, 1.0, setting).problem
        declared = clip.model_copy(
            update={"ramp_angle_deg": setting.get("angle", setting.get("angle_deg", 20.0))}
        )
        assert release_m(declared, made) == pytest.approx(release, abs=2e-3), setting
        if "height" in setting:
            assert height_m(declared, made) == pytest.approx(setting["height"], abs=1e-3)


def test_a_fast_camera_sees_with_less_error_not_with_more_frames(trials, clip):
    slow, fast = (propose(clip, trials, 1.0, {"fps": fps}).problem for fps in (30.0, 240.0))
    assert len(fast.observation.times_s) <= MOST_FRAMES + 1
    ratio = slow.observation.covariance_m2[0, 0, 0, 0] / fast.observation.covariance_m2[0, 0, 0, 0]
    assert ratio == pytest.approx(6.0), "the mean of six"
    assert fast.observation.times_s[1] == pytest.approx(6 / 240)


def test_swapped_objects_keep_their_masses_and_frictions(trials, clip):
    made = propose(clip, trials, 1.0, {"swap": 1.0, "mass2": 0.7})
    scene, before = made.problem.model.scene.surroundings, trials.problems[0].model.scene
    assert scene.half_length_m == before.surroundings.half_length_m[::-1]
    assert made.renamed["k1"] == "k2" and made.fixed == {"m1": 0.7}, "object 2 comes down now"


@pytest.mark.parametrize(
    ("setting", "complaint"),
    [
        ({"height": 0.1, "release": 0.2}, "height and release say the same"),
        ({"angle": 0.5}, "angle: 0.5 is not a slope"),
    ],
)
def test_what_has_no_place_is_refused(trials, clip, setting, complaint):
    with pytest.raises(InputError, match=complaint):
        propose(clip, trials, 1.0, setting)


def test_whether_it_hits_is_seen(trials, clip):
    beliefs = beliefs_of(diagnosis_of(trials, "ambiguous")).of
    low, high = (
        predict_experiment(propose(clip, trials, 1.0, {"height": height}), trials, beliefs, 0)
        for height in (0.02, 0.3)
    )
    assert all(one.hits == 0.0 for one in low) and all(one.hits == 1.0 for one in high)


def test_the_hypotheses_come_back_from_disk(trials, tmp_path):
    beliefs = beliefs_of(diagnosis_of(trials, "ambiguous"))
    assert [one.name for one in beliefs.of][:2] == ["air_drag", "viscous_drag"]
    write_beliefs(tmp_path / "h.npz", trials, beliefs)
    again = read_beliefs(tmp_path / "h.npz", trials.names)
    assert again.margin == beliefs.margin
    for one, other in zip(beliefs.of, again.of, strict=True):
        assert (one.effects, one.log_odds) == (other.effects, other.log_odds)
        np.testing.assert_array_equal(one.covariance, other.covariance)
        np.testing.assert_array_equal(one.z, other.z)
    with pytest.raises(InputError, match="of another model"):
        read_beliefs(tmp_path / "h.npz", trials.names[1:])
    (tmp_path / "h.npz").write_text("x")
    with pytest.raises(InputError, match="not the hypotheses"):
        read_beliefs(tmp_path / "h.npz", trials.names)
    with pytest.raises(InputError, match="no such file"):
        read_beliefs(tmp_path / "none.npz", trials.names)


def test_the_best_setting_comes_first_and_the_sentence_says_it(found, tmp_path):
    ahead = next_experiment(found, can="height=0.05:0.3,fps=30|60", seed=1)
    gains = ahead.table["gain_nats"].to_numpy()
    assert ahead.table.columns.tolist() == [
        *("height", "fps", "gain_nats", "named", "lead_nats", "hit")
    ]
    assert gains[0] >= gains.max() - 0.01 and gains[0] > gains[-1]
    entropy = -sum(p * math.log(p) for p in ahead.hypotheses.values())
    assert (gains >= 0).all() and (gains <= entropy + 0.05).all()
    assert ahead.best["height"] > 0.1, "drags differ where it is fast"
    assert ahead.sentence.startswith("release object 1 from")
    assert "named with probability" in ahead.sentence
    ahead.save(tmp_path)
    page = (tmp_path / "next.html").read_text()
    assert ahead.sentence in page and "air_drag" in page
    again = next_experiment(found, can="height=0.05:0.3,fps=30|60", seed=1)
    assert again.document["settings"] == ahead.document["settings"]


def test_about_a_parameter(found, trials, clip):
    ahead = next_experiment(found, can="height=0.05:0.3", about="k2")
    table = ahead.table.set_index("height")
    low, high = (float(table.at[height, "gain_nats"]) for height in (0.05, 0.3))  # pyright: ignore
    assert low < high, "object 2 is hit harder"
    assert "k2 becomes" in ahead.sentence
    beliefs = beliefs_of(found.found)
    ratio = expect(clip, trials, beliefs, [{"height": 0.2}], "mass_ratio")
    assert best_first(ratio)[0].gain_nats > 0
    for about, line in (
        ("k9", "not a parameter of a likely"),
        ("m1", "only the ratio of the masses"),
    ):
        with pytest.raises(InputError, match=line):
            next_experiment(found, can="height=0.05:0.3", about=about)


def test_an_ambiguous_verdict_advises_what_to_measure(found, trials, clip):
    before = found.found.verdict.advice
    told = with_next(found.found, clip, trials, 0).verdict
    assert told.advice[0].startswith("measure next: release object 1 from")
    assert told.advice[1:] == before
    named = diagnosis_of(trials, "named")
    assert with_next(named, clip, trials, 0) is named


def test_hypotheses_that_no_experiment_can_tell_apart(found, trials, clip):
    """The same hypothesis twice."""
    beliefs = beliefs_of(found.found)
    twins = replace(
        beliefs, of=(beliefs.of[0], replace(beliefs.of[0], log_odds=beliefs.of[0].log_odds))
    )
    (one,) = expect(clip, trials, twins, [{"height": 0.2}])
    assert one.gain_nats == pytest.approx(0.0, abs=1e-6) and one.named == 0.0


@pytest.mark.parametrize(("foot", "first"), [((0.0, 0.0), "fps"), ((0.6, -0.25), "height")])
def test_no_height_is_proposed_where_the_foot_is_not_known(foot, first, tmp_path):
    """A board whose places are counted from where its object is first seen: it starts below it."""
    times = np.arange(30) / 60
    gone = 0.5 * 1.8 * times**2
    rows = [
        f"{t},{s * math.cos(0.4) - foot[0]},{-0.004 - s * math.sin(0.4) - foot[1]},0.0005"
        for t, s in zip(times, gone, strict=True)
    ]
    path = tmp_path / "board.csv"
    path.write_text("\n".join(["time_s,block_x_m,block_y_m,block_sd_m", *rows]))
    path.with_suffix(".yaml").write_text(
        "track: board.csv\nscenario: incline\nramp_angle_deg: 22.918\n"
        "objects: [{name: block, shape: box}]\n"
    )
    clip = load_clip(path)
    trials = JointProblem((make_problem(clip, read_observation_csv(path), "auto", ()),))
    can = parse_can(default_can(clip, trials))
    assert next(iter(can)) == first and "angle" in can


def test_on_a_level_table_no_slope_can_be_set(tmp_path):
    times = np.arange(30) / 60
    rows = [f"{t},{1.5 * t - 0.5 * 2.0 * t**2}" for t in times]
    path = tmp_path / "level.csv"
    path.write_text("\n".join(["t (s),x (m)", *rows]))
    path.with_suffix(".yaml").write_text(
        "track: level.csv\nscenario: level\nobjects: [{name: block, shape: box}]\n"
    )
    measured = measure(load_clip(path))
    trials = JointProblem((make_problem(measured.clip, measured.observation, "auto", ()),))
    assert list(default_can(measured.clip, trials)) == ["fps"]
    with pytest.raises(InputError, match="height has no place in scenario level"):
        propose(measured.clip, trials, 1.0, {"height": 0.1})
