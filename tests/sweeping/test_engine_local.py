"""The local engine: every task has one outcome, whatever becomes of it and of its worker."""

import pytest

from galileo_jax.sweeping.engine_local import EngineHere, EngineLocal
from galileo_jax.sweeping.task import MAX_TRIES, Task
from tests.sweeping import work_to_do


@pytest.fixture(scope="module")
def local():
    engine = EngineLocal(2)
    yield engine
    engine.close()


@pytest.fixture(params=["here", "local"])
def engine(request, local):
    return EngineHere() if request.param == "here" else local


def test_every_task_has_one_outcome(engine):
    tasks = [Task(str(n), work_to_do.double, (n,)) for n in range(20)]
    found = list(engine.outcomes(tasks))
    assert sorted(found, key=lambda o: int(o.key)) == [
        type(found[0])(str(n), 2 * n) for n in range(20)
    ]


def test_what_is_raised_is_a_failure_and_the_others_go_on(engine):
    tasks = [
        Task("wrong", work_to_do.double, (-1,)),
        Task("bug", work_to_do.divide, (0,)),
        Task("fine", work_to_do.divide, (4,)),
    ]
    found = {outcome.key: outcome for outcome in engine.outcomes(tasks)}
    assert found["fine"].value == 0.25
    wrong, bug = found["wrong"].failure, found["bug"].failure
    assert (wrong.kind, wrong.line) == ("input", "number: negative; 0 or more expected")
    assert (bug.kind, bug.line) == ("bug", "ZeroDivisionError: division by zero")
    assert "work_to_do.py" in bug.details


def test_a_task_is_tried_again_when_its_worker_dies(local, tmp_path):
    tasks = [Task("d", work_to_do.die, (tmp_path, 1)), Task("1", work_to_do.double, (1,))]
    found = {outcome.key: outcome.value for outcome in local.outcomes(tasks)}
    assert found == {"d": "alive", "1": 2}


def test_a_task_that_no_worker_survives_fails_alone(local, tmp_path):
    tasks = [Task("d", work_to_do.die, (tmp_path, 99))]
    tasks += [Task(str(n), work_to_do.double, (n,)) for n in range(5)]
    found = {outcome.key: outcome for outcome in local.outcomes(tasks)}
    assert found["d"].failure.kind == "died"
    assert "SIGKILL" in found["d"].failure.line
    assert len(list(tmp_path.iterdir())) == MAX_TRIES
    assert [found[str(n)].value for n in range(5)] == [0, 2, 4, 6, 8]


def test_workers_compute_on_one_core_and_no_gpu(local):
    names = ("XLA_FLAGS", "OPENBLAS_NUM_THREADS", "JAX_PLATFORMS")
    tasks = [Task(name, work_to_do.environment, (name,)) for name in names]
    found = {outcome.key: outcome.value for outcome in local.outcomes(tasks)}
    assert "--xla_cpu_multi_thread_eigen=false" in found["XLA_FLAGS"]
    assert (found["OPENBLAS_NUM_THREADS"], found["JAX_PLATFORMS"]) == ("1", "cpu")


def test_takes_tasks_only_as_workers_become_free(local):
    taken = []

    def tasks():
        for n in range(50):
            taken.append(n)
            yield Task(str(n), work_to_do.double, (n,))

    for done, _ in enumerate(local.outcomes(tasks()), 1):
        assert len(taken) <= done + local.num_workers
