"""Sweeps of real fits: ready configs, kills, Ray with a node that is lost."""

import csv
import threading
import time

import pytest

from galileo_jax.api.simulate import simulate
from galileo_jax.commands import command, sweep
from galileo_jax.files.package_data import config_path
from galileo_jax.sweeping.resources import Resources
from galileo_jax.sweeping.task import Task
from tests.missing import needed_module
from tests.precision import in_64_bit
from tests.sweeping import work_to_do
from tests.sweeping.killed import kill_and_resume

SMALL = {
    "thesis_ablation": ["simulate=[{count: 1}]", "list.5.chains=2"],
    "samplers": [
        "simulate=[{count: 1}]",
        "grid={}",
        "list=[{method: grad}, {method: cnn}, {method: mh, chains: 2, max_steps: 25},"
        " {method: mh, sampler: random_walk, chains: 2, max_steps: 25}]",
    ],
    "hidden_effects": ["simulate=[{count: 1}, {count: 1, effect: air_drag, strength: 0.8}]"],
    "physics101": ["clips=[{folder}/*.csv]"],
}


@pytest.fixture(autouse=True)
def precision():
    with in_64_bit():
        yield


def rows_of(folder):
    with (folder / "summary.csv").open() as stream:
        return list(csv.DictReader(stream))


@pytest.fixture(scope="module")
def tracks(tmp_path_factory):
    folder = tmp_path_factory.mktemp("tracks")
    for seed in range(4):
        simulate(folder / f"track_{seed}.csv", track_only=True, seed=seed)
    return folder


@pytest.mark.slow
@pytest.mark.parametrize("name", SMALL)
def test_ready_configs_run(name, tracks, tmp_path):
    changes = [part.format(folder=tracks) if "{folder}" in part else part for part in SMALL[name]]
    words = [str(config_path(f"{name}.yaml")), "--out", str(tmp_path), "--workers", "0"]
    for change in changes:
        words += ["--set", change]
    assert command.run(sweep.main, words) == 0
    rows = rows_of(tmp_path)
    assert rows and all(row["status"] == "done" for row in rows), [r["failure"] for r in rows]
    if name == "hidden_effects":
        assert rows[1]["verdict"] == "air_drag"


@pytest.fixture
def plan(tracks, tmp_path):
    path = tmp_path / "plan.yaml"
    path.write_text(f"clips: ['{tracks}/*.csv']\ncommon: {{method: cnn}}\n"
                    f"grid: {{seed: {list(range(24))}}}")  # fmt: skip
    return path


@pytest.mark.slow
def test_killed_ten_times_the_summary_is_the_same(plan, tmp_path):
    found = kill_and_resume(tmp_path, [str(plan), "--workers", "1"], kills=10)
    assert found.is_same
    assert not found.partial
    assert not found.left_alive
    assert found.done == sorted(found.done), "nothing done is lost"
    assert found.num_killed >= 5 and found.done[0] < found.done[-1], "killed while at work"


@pytest.fixture
def cluster():
    """A real Ray cluster of two nodes on this machine, each with one core."""
    needed_module("ray", "distributed")
    from ray.cluster_utils import Cluster  # pyright: ignore[reportMissingImports]

    found = Cluster(initialize_head=True, head_node_args={"num_cpus": 1})
    yield found
    found.shutdown()


@pytest.mark.slow
@pytest.mark.filterwarnings("default")
def test_ray_loses_a_node_and_nothing_else(cluster, tmp_path):
    """Every task has one outcome, though a node is killed half way."""
    from galileo_jax.sweeping.engine_ray import EngineRay

    second = cluster.add_node(num_cpus=1)
    cluster.wait_for_nodes()
    engine = EngineRay(cluster.address, Resources())
    tasks = [Task(str(n), work_to_do.slow_double, (n, str(tmp_path))) for n in range(40)]
    found = []
    try:
        for outcome in engine.outcomes(tasks):
            found.append(outcome)
            if len(found) == 20:
                cluster.remove_node(second, allow_graceful=False)
    finally:
        engine.close()
    assert sorted(int(outcome.key) for outcome in found) == list(range(40))
    assert {int(o.key): o.value for o in found} == {n: 2 * n for n in range(40)}
    assert len({path.name.split("_")[1] for path in tmp_path.iterdir()}) >= 2, "both nodes worked"


@pytest.mark.slow
@pytest.mark.filterwarnings("default")
@pytest.mark.parametrize("what", ["plan", "folder"])
def test_ray_equals_local_to_the_last_digit(what, cluster, tracks, tmp_path):
    """A folder of clips also where a node is lost after the first of them."""
    second = cluster.add_node(num_cpus=1)
    cluster.wait_for_nodes()
    plan = tmp_path / "plan.yaml"
    plan.write_text(
        f"clips: ['{tracks}/*.csv']\nlist: [{{method: cnn}}, {{method: grad}}, {{method: explain}}]"
    )
    words = [str(plan if what == "plan" else tracks)]
    where = {"local": ["--workers", "1"], "ray": ["--engine", "ray", "--address", cluster.address]}

    def lose_second() -> None:
        while not any((tmp_path / "ray").rglob("result.json")):
            time.sleep(0.1)
        cluster.remove_node(second, allow_graceful=False)

    if what == "folder":
        threading.Thread(target=lose_second, daemon=True).start()
    for name, more in where.items():
        assert command.run(sweep.main, [*words, *more, "--out", str(tmp_path / name)]) == 0
    for file in ("summary.csv", "summary.parquet"):
        assert (tmp_path / "local" / file).read_bytes() == (tmp_path / "ray" / file).read_bytes()
    assert what == "plan" or len(cluster.list_all_nodes()) == 1


@pytest.mark.slow
@pytest.mark.filterwarnings("default")
def test_ray_without_an_answer_is_one_line(plan, tmp_path, capsys):
    needed_module("ray", "distributed")
    words = [str(plan), "--engine", "ray", "--address", "127.0.0.1:1", "--out", str(tmp_path / "o")]
    assert command.run(sweep.main, words) == 2
    assert "--address: no Ray cluster at 127.0.0.1:1" in capsys.readouterr().err
