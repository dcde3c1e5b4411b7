"""What one worker of a sweep may use, and how its process learns of it before it imports JAX."""

import os
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from galileo_jax.api.options import check_choices
from galileo_jax.runtime.errors import InputError


@dataclass(frozen=True)
class Resources:
    """Of one worker."""

    cpus: int = 1  # cores
    gpus: int = 0  # whole GPUs; 0: the worker computes on the CPU, whatever there is

    def environment(self) -> dict[str, str]:
        """Variables of a worker's process.

        One thread for each core it has, so that workers do not wait for each other; with one
        core XLA never splits a sum, and results have the same digits on every machine of a kind.
        """
        threads = {name: str(self.cpus) for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS")}
        flags = os.environ.get("XLA_FLAGS", "")
        if self.cpus == 1 and SINGLE_THREAD not in flags:
            flags = f"{flags} {SINGLE_THREAD}".strip()
        platform = {} if self.gpus else {"JAX_PLATFORMS": "cpu"}
        return threads | platform | ({"XLA_FLAGS": flags} if flags else {})


@dataclass(frozen=True)
class Computing:
    """Where a sweep is computed; the arguments of `sweep` of the same names."""

    engine: Literal["local", "ray"] = "local"
    address: str | None = None
    workers: int | None = None
    cpus_per_worker: int = 1
    gpus_per_worker: int = 0
    together: int | None = None

    @property
    def each(self) -> Resources:
        """What one worker may use."""
        return Resources(self.cpus_per_worker, self.gpus_per_worker)

    def check(self) -> None:
        """Raises `InputError` where the options are wrong or do not go together."""
        check_choices(self)
        if self.address and self.engine != "ray":
            raise InputError("--address: for --engine ray only")
        for name, least in LEAST.items():
            value = getattr(self, name)
            if value is not None and value < least:
                option = name.replace("_", "-")
                raise InputError(f"--{option}: {value} is not a whole number, {least} or more")
        in_workers = self.engine != "local" or self.workers or self.gpus_per_worker
        if self.together is not None and self.together > 1 and in_workers:
            raise InputError(
                "--together: cells are computed together in one process; leave out --engine, "
                "--workers and --gpus-per-worker"
            )

    def num_together(self) -> int:
        """How many cells one process computes together: where it is not said, 1 on a CPU."""
        if self.together is not None:
            return self.together
        is_free = self.engine == "local" and self.workers is None and not self.gpus_per_worker
        if not is_free or not local_gpus():
            return 1
        import jax

        return NUM_TOGETHER if jax.default_backend() != "cpu" else 1


LEAST = {"workers": 0, "cpus_per_worker": 1, "gpus_per_worker": 0, "together": 1}
NUM_TOGETHER = 64  # cells whose program calls an accelerator makes at once
SINGLE_THREAD = "--xla_cpu_multi_thread_eigen=false"


def num_workers(each: Resources) -> int:
    """How many workers this machine has room for, at least one."""
    room = len(os.sched_getaffinity(0)) // each.cpus
    if each.gpus:
        room = min(room, len(local_gpus()) // each.gpus)
    return max(room, 1)


def local_gpus() -> list[str]:
    """The GPUs of this machine that this process may use, as CUDA names them."""
    visible = os.environ.get("CUDA_VISIBLE_DEVICES")
    if visible is not None:
        return [name for name in visible.split(",") if name]
    return [str(i) for i in range(len(list(Path("/dev").glob("nvidia[0-9]*"))))]


def environment_of(worker: int, each: Resources) -> Mapping[str, str]:
    """The environment of a machine's worker number `worker`: its own GPUs, no one else's."""
    if not each.gpus:
        return each.environment()
    own = local_gpus()[worker * each.gpus : (worker + 1) * each.gpus]
    return each.environment() | {"CUDA_VISIBLE_DEVICES": ",".join(own)}
