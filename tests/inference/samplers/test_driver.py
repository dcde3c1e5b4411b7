"""The driver: evaluations, determinism, resuming, stopping, and what it refuses."""

import functools
import os
import signal

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from galileo_jax.inference.posterior import Status
from galileo_jax.inference.samplers.driver import Settings, sample
from galileo_jax.inference.samplers.library.mixture import Mixture
from galileo_jax.inference.samplers.program import Program
from galileo_jax.runtime.errors import InputError
from tests.inference.samplers.targets import dispersed_starts, gaussian

TARGET = gaussian(3)
NAMES = ("a", "b", "c")
SHORT = Settings(warmup_steps=50, block_steps=25, max_steps=100, stops_early=False)


def start(seed=1, num_chains=4):
    return dispersed_starts(
        jax.random.key(seed), jnp.asarray(TARGET.mean), jnp.asarray(TARGET.covariance), num_chains
    )


def sampler():
    return Mixture.from_gaussian(jnp.asarray(TARGET.mean), jnp.asarray(TARGET.covariance))


def run(seed=0, log_density=TARGET.log_density, settings=SHORT, **options):
    options.setdefault("start", start())
    return sample(
        jax.random.key(seed), sampler(), log_density, names=NAMES, settings=settings, **options
    )


def test_same_key_same_draws_and_another_key_others():
    first, again, other = run(0), run(0), run(1)
    np.testing.assert_array_equal(first.draws, again.draws)
    np.testing.assert_array_equal(first.log_density, again.log_density)
    assert not np.array_equal(first.draws, other.draws)


def test_every_evaluation_is_counted_and_a_turn_of_all_chains_goes_together():
    batches = []

    def engine(z):
        batches.append(z.shape)
        return (-0.5 * np.sum(z**2, axis=-1)).astype(np.float32)

    def log_density(z):
        shape = jax.ShapeDtypeStruct((), jnp.float32)
        return jax.pure_callback(engine, shape, z, vmap_method="expand_dims")

    posterior = run(log_density=log_density)
    assert batches == [(4, 3)] + 30 * [(4, 5, 3)]
    assert posterior.stats["num_evaluations"] == 4 * (1 + 150)


def test_log_density_belongs_to_the_draws():
    posterior = run()
    expected = jax.vmap(jax.vmap(TARGET.log_density))(jnp.asarray(posterior.draws))
    np.testing.assert_allclose(posterior.log_density, expected, atol=1e-4)


def gaussian_code(data, z):
    return -0.5 * jnp.sum(((z - data["mean"]) / data["sd"]) ** 2)


def test_a_program_is_a_density_and_is_compiled_once_for_all_data():
    traces = []

    def counted(data, z):
        traces.append(1)
        return gaussian_code(data, z)

    def data(mean):
        return {"mean": jnp.asarray(mean), "sd": jnp.asarray([1.0, 2.0, 3.0])}

    first = run(log_density=Program((counted,), data([0.0, 0.0, 0.0])))
    closure = run(log_density=functools.partial(gaussian_code, data([0.0, 0.0, 0.0])))
    np.testing.assert_allclose(first.draws, closure.draws, rtol=1e-4, atol=1e-5)
    so_far = len(traces)
    other = run(log_density=Program((counted,), data([5.0, 5.0, 5.0])))
    assert len(traces) == so_far > 0
    assert other.draws.mean() > first.draws.mean() + 2


class StopError(Exception):
    """Stands for whatever ends a run from outside."""


@pytest.mark.parametrize("stop_at", [25, 50, 75, 125])
def test_resumed_run_is_the_undisturbed_run(tmp_path, stop_at):
    path = tmp_path / "run.npz"

    def stop(progress):
        if progress.num_steps == stop_at:
            raise StopError

    with pytest.raises(StopError):
        run(checkpoint=path, on_block=stop)
    seen = []
    resumed = run(checkpoint=path, on_block=lambda progress: seen.append(progress.num_steps))
    assert seen[0] == stop_at + 25
    undisturbed = run()
    np.testing.assert_array_equal(resumed.draws, undisturbed.draws)
    np.testing.assert_array_equal(resumed.log_density, undisturbed.log_density)
    assert resumed.stats == undisturbed.stats


def test_resuming_stops_where_the_undisturbed_run_stops(tmp_path):
    settings = Settings(warmup_steps=50, block_steps=25, max_steps=5000, min_ess=300)
    path = tmp_path / "run.npz"

    def stop(progress):
        if progress.num_steps == 225:
            raise StopError

    with pytest.raises(StopError):
        run(settings=settings, checkpoint=path, on_block=stop)
    undisturbed = run(settings=settings)
    assert undisturbed.is_converged
    resumed = run(settings=settings, checkpoint=path)
    np.testing.assert_array_equal(resumed.draws, undisturbed.draws)
    finished = run(settings=settings, checkpoint=path, on_block=lambda _: pytest.fail("went on"))
    assert finished.is_converged


def test_ctrl_c_ends_at_the_block_and_loses_nothing(tmp_path):
    path = tmp_path / "run.npz"
    is_first = [True]

    def engine(z):
        if is_first.pop() if is_first else False:
            return np.zeros(z.shape[:-1], np.float32)
        if not path.exists() and not sent:
            sent.append(True)
            os.kill(os.getpid(), signal.SIGINT)
        return (-0.5 * np.sum(z**2, axis=-1)).astype(np.float32)

    sent = []

    def log_density(z):
        shape = jax.ShapeDtypeStruct((), jnp.float32)
        return jax.pure_callback(engine, shape, z, vmap_method="expand_dims")

    before = signal.getsignal(signal.SIGINT)
    with pytest.raises(KeyboardInterrupt):
        run(log_density=log_density, checkpoint=path)
    assert signal.getsignal(signal.SIGINT) is before
    seen = []
    run(
        log_density=log_density,
        checkpoint=path,
        on_block=lambda progress: seen.append(progress.num_steps),
    )
    assert seen[0] == 50


@pytest.mark.parametrize(
    "other",
    [
        {"seed": 2},
        {"start": start(9)},
        {"identity": "another clip"},
        {"settings": Settings(75, 25, 100, stops_early=False)},
    ],
    ids=["seed", "start", "identity", "settings"],
)
def test_checkpoint_of_another_run_is_refused(tmp_path, other):
    path = tmp_path / "run.npz"
    run(checkpoint=path)
    with pytest.raises(InputError, match=r"run\.npz: belongs to a run with another seed"):
        run(checkpoint=path, **other)


def test_damaged_checkpoint_is_refused(tmp_path):
    path = tmp_path / "run.npz"
    run(checkpoint=path)
    path.write_bytes(path.read_bytes()[:200])
    with pytest.raises(InputError, match=r"run\.npz: not a checkpoint"):
        run(checkpoint=path)


def test_more_steps_continue_a_finished_run(tmp_path):
    path = tmp_path / "run.npz"
    short = run(checkpoint=path)
    longer = run(checkpoint=path, settings=Settings(50, 25, 200, stops_early=False))
    assert longer.draws.shape == (4, 200, 3)
    np.testing.assert_array_equal(longer.draws[:, :100], short.draws)


def test_monitored_quantities_alone_decide():
    settings = Settings(warmup_steps=50, block_steps=25, max_steps=500)

    def independent(draws):
        return {"noise": np.random.default_rng(0).normal(size=draws.shape[:2])}

    early = run(settings=settings, monitor=independent)
    assert early.is_converged
    assert early.stats["num_steps"] < 300

    def independent_and_fixed(draws):
        return {**independent(draws), "fixed": np.ones(draws.shape[:2])}

    late = run(settings=settings, monitor=independent_and_fixed)
    assert late.status is Status.STEP_LIMIT
    assert late.stats["num_steps"] == 550


def test_step_limit_and_stuck_chain_are_told_apart():
    short = run(settings=Settings(warmup_steps=0, block_steps=25, max_steps=25))
    assert short.status is Status.STEP_LIMIT

    def needle(z):
        return jnp.where(jnp.all(z == 0), 0.0, -jnp.inf)

    stuck = run(
        log_density=needle,
        start=jnp.zeros((4, 3)),
        settings=Settings(warmup_steps=25, block_steps=25, max_steps=50),
    )
    assert stuck.status is Status.STUCK_CHAIN
    assert not stuck.is_converged


def test_progress_reports():
    reports = []
    run(settings=Settings(50, 25, 100, max_rhat=0.0), on_block=reports.append)
    assert [report.num_steps for report in reports] == [25, 50, 75, 100, 125, 150]
    assert [report.is_warmup for report in reports] == [True, True] + 4 * [False]
    assert set(reports[-1].convergence) == set(NAMES)
    assert reports[0].max_steps == 150
    assert 0 < reports[0].acceptance_rate < 1


def test_non_finite_start_is_refused():
    bad = start().at[2, 0].set(jnp.nan)
    with pytest.raises(ValueError, match="log density is nan at the start of chain 2"):
        run(start=bad)


def test_wrong_shapes_and_settings_are_refused():
    with pytest.raises(ValueError, match=r"start \(4, 2\) is not \[chain, 3\]"):
        run(start=jnp.zeros((4, 2)))
    with pytest.raises(ValueError, match="max_steps is 110, not a multiple of block_steps 25"):
        Settings(max_steps=110)
    with pytest.raises(ValueError, match="block_steps is 0; it must be at least 1"):
        Settings(block_steps=0)
    with pytest.raises(ValueError, match="block_steps is 12; mixture makes 5 steps at a time"):
        run(settings=Settings(warmup_steps=0, block_steps=12, max_steps=24))
