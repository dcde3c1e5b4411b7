"""Fits whose batches are merged are the fits that each clip would have alone."""

import pytest

import galileo_jax as gx
from galileo_jax.runtime.progress import Cancelled
from galileo_jax.sweeping.engine_local import EngineHere
from galileo_jax.sweeping.engine_together import EngineTogether
from galileo_jax.sweeping.task import Task
from tests.sweeping import work_to_do

ROUNDING = 1e-8  # of z: sums of merged programs may have another order
# Of a standard deviation: where rounding decides, one of 4,000 draws of the posterior is another.
ONE_DRAW = 0.03


def fitted(path):
    found = gx.fit(path)
    assert found.gradient is not None
    return found.gradient.z.tolist(), found.result["parameters"]


@pytest.fixture(scope="module")
def tracks(tmp_path_factory):
    folder = tmp_path_factory.mktemp("tracks")
    for seed in range(3):
        path = folder / f"{seed}.csv"
        gx.simulate(path, scenario="incline", seed=seed, angle=20.0, track_only=True)
    return sorted(folder.glob("*.csv"))


def test_fits_are_those_of_each_clip_alone(tracks):
    tasks = [Task(path.stem, fitted, (path,)) for path in tracks]
    alone = {outcome.key: outcome.value for outcome in EngineHere().outcomes(tasks)}
    engine = EngineTogether(3)
    merged = {outcome.key: outcome.value for outcome in engine.outcomes(tasks)}
    assert merged.keys() == alone.keys()
    for key, (z, parameters) in alone.items():
        best, found = merged[key]
        assert best == pytest.approx(z, abs=ROUNDING)
        for name, entry in parameters.items():
            few = ONE_DRAW * entry["sd"]
            assert found[name]["mean"] == pytest.approx(entry["mean"], abs=few)
            assert found[name]["sd"] == pytest.approx(entry["sd"], abs=few)
    assert engine.group.num_made < 0.7 * engine.group.num_calls


def test_more_tasks_than_threads_and_one_that_fails():
    tasks = [Task(str(n), work_to_do.double, (n,)) for n in range(-1, 9)]
    found = {outcome.key: outcome for outcome in EngineTogether(3).outcomes(tasks)}
    failure = found["-1"].failure
    assert failure is not None and failure.kind == "input"
    assert [found[str(n)].value for n in range(9)] == [2 * n for n in range(9)]


def cancel():
    raise Cancelled("cancelled")


def test_cancelled_is_nobody_s_failure():
    with pytest.raises(Cancelled):
        list(EngineTogether(2).outcomes([Task("0", cancel, ())]))


def test_a_sweep_gives_the_same_table(tracks, tmp_path):
    config = {"clips": [str(path) for path in tracks]}
    one = gx.sweep(config, out=tmp_path / "one", workers=0).rows
    many = gx.sweep(config, out=tmp_path / "many", together=3).rows
    assert list(many["status"]) == ["done"] * 3
    few = ONE_DRAW * one["k1_sd"].to_numpy()
    assert (abs(many["k1"] - one["k1"]).to_numpy() <= few).all()


def test_together_is_one_process(tracks, tmp_path):
    with pytest.raises(gx.InputError, match="--together: cells are computed together"):
        gx.sweep({"clips": [str(tracks[0])]}, out=tmp_path / "s", together=2, workers=2)
