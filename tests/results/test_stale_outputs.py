"""What other commands left in a run's folder: gone or told of where it is wrong, never else."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from galileo_jax.api.fit_result import Found, make_fit
from galileo_jax.inference.joint_problem import JointProblem
from galileo_jax.inference.posterior import Posterior, Status
from galileo_jax.measurement.measure import Measurement
from galileo_jax.observation.digest import digest
from galileo_jax.results.run import Run, load_run
from galileo_jax.results.stale_outputs import TRACKS, remove_stale_prediction, stale_documents
from tests.oracle_run import HIT, make_run
from tests.precision import in_64_bit

PREDICTED = ("prediction.json", "prediction.svg", "prediction.html", "first_and_last.png")
OURS = {"run": "runs/a", "seconds_beyond_clip_s": 1.0, "version": "0.1"}


@pytest.fixture(autouse=True)
def precision():
    with in_64_bit():
        yield


def fit_again(run: Run, names: tuple[str, ...]) -> None:
    """Writes the fit of as many copies of the run's clip into the run's folder."""
    named = {name: f"{name}.csv" for name in names}
    clips = [
        run.clip.model_copy(update={"path": Path(file), "source": file}) for file in named.values()
    ]
    seen = run.problem.observation
    trials = JointProblem(tuple(replace(run.problem, name=name) for name in names))
    z = 0.1 * np.random.default_rng(0).standard_normal((8, len(trials.parameters)))
    posterior = Posterior(trials.names, trials.theta(z)[None], np.zeros((1, 8)), Status.CONVERGED)
    found = Found(trials, posterior, z[0], {"status": "the fit converged"})
    measured = [Measurement(clip, seen, seen) for clip in clips]
    made = make_fit(measured, found, method="grad", seed=0, timings={})
    made.save(run.folder, report=False)


def write_predicted(folder: Path, content: object) -> None:
    for name in PREDICTED:
        (folder / name).write_text("of the earlier fit")
    (folder / "prediction.json").write_text(json.dumps(content))


def test_a_new_fit_takes_the_earlier_ones_prediction_away(tmp_path):
    run = make_run(tmp_path, HIT, 0.9)
    write_predicted(run.folder, OURS)
    for name in ("notes.txt", "my_prediction.svg"):
        (run.folder / name).write_text("the user's")
    fit_again(run, ("one",))
    left = {path.name for path in run.folder.iterdir()}
    assert not left & set(PREDICTED)
    assert {"notes.txt", "my_prediction.svg", "result.json"} <= left


@pytest.mark.parametrize("content", [{"version": "0.1"}, ["a list"], {}])
def test_what_is_not_ours_stays(tmp_path, content):
    write_predicted(tmp_path, content)
    remove_stale_prediction(tmp_path)
    assert {path.name for path in tmp_path.iterdir()} == set(PREDICTED)


def test_of_several_clips_no_run_of_one_is_left(tmp_path):
    """`predict` and `compare` would take the earlier clip for the one that was fitted."""
    run = make_run(tmp_path, HIT, 0.9)
    fit_again(run, ("one", "two"))
    assert not (run.folder / "clip.yaml").exists()
    assert not (run.folder / "observation.csv").exists()
    assert load_run(run.folder / "one").result["clips"] == ["one.csv"]


def test_a_diagnosis_of_another_track_is_told_of(tmp_path):
    seen = make_run(tmp_path / "clip", HIT, 0.9).problem.observation
    moved = replace(seen, position_m=seen.position_m + 1e-6)
    (tmp_path / "diagnosis").mkdir()
    document = {"clips": ["a.csv"], TRACKS: [digest(seen)]}
    (tmp_path / "diagnosis" / "diagnosis.json").write_text(json.dumps(document))
    assert stale_documents(tmp_path, [seen]) == []
    (told,) = stale_documents(tmp_path, [moved])
    assert "diagnosis: made from an earlier track" in told and "galileo diagnose a.csv" in told
    unseen = replace(seen, position_m=np.where(seen.mask[:, None], seen.position_m, np.nan))
    assert digest(unseen) == digest(seen)
