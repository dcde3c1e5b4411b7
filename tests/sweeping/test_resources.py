"""What a worker may use."""

import os

import pytest

from galileo_jax.sweeping import resources
from galileo_jax.sweeping.resources import Resources, environment_of, local_gpus, num_workers


@pytest.fixture
def machine(monkeypatch):
    """Four cores, and three GPUs of which two are ours."""
    monkeypatch.setattr(os, "sched_getaffinity", lambda process: {0, 1, 2, 3})
    monkeypatch.setenv("CUDA_VISIBLE_DEVICES", "0,2")
    monkeypatch.delenv("XLA_FLAGS", raising=False)


def test_as_many_workers_as_there_is_room_for(machine):
    assert num_workers(Resources()) == 4
    assert num_workers(Resources(cpus=3)) == 1
    assert num_workers(Resources(cpus=1, gpus=1)) == 2
    assert num_workers(Resources(gpus=8)) == 1


def test_every_worker_has_its_own_gpus(machine):
    found = [environment_of(worker, Resources(gpus=1)) for worker in (0, 1)]
    assert [each["CUDA_VISIBLE_DEVICES"] for each in found] == ["0", "2"]
    assert "JAX_PLATFORMS" not in found[0]


def test_without_gpus_a_worker_computes_on_its_cores(machine, monkeypatch):
    environment = environment_of(0, Resources(cpus=2))
    assert environment == {
        "JAX_PLATFORMS": "cpu", "OMP_NUM_THREADS": "2", "OPENBLAS_NUM_THREADS": "2",
    }  # fmt: skip
    monkeypatch.setenv("XLA_FLAGS", "--xla_dump_to=x")
    assert Resources().environment()["XLA_FLAGS"] == f"--xla_dump_to=x {resources.SINGLE_THREAD}"
    monkeypatch.setenv("CUDA_VISIBLE_DEVICES", "")
    assert local_gpus() == []
