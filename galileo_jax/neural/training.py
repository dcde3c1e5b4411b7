"""The training loop: epochs of Adam, a rate cut at plateaus, checkpoints, resume.

plateau     rate <- rate * cut after `patience` epochs without a better validation loss, and
            on from the best weights; the end is the plateau after the last cut
cosine      the rate stays for a third of all epochs, and falls to zero from there on
"""

import math
import time
from pathlib import Path
from typing import Any

import jax
import jax.numpy as jnp
import optax
from flax import nnx

from galileo_jax.neural.checkpoint import (
    NETWORK,
    Progress,
    State,
    load_checkpoint,
    save_checkpoint,
    save_network,
)
from galileo_jax.neural.config import TrainConfig
from galileo_jax.neural.task import Arrays, Task
from galileo_jax.runtime.progress import report

SAVE_EVERY_S = 15.0


def train(task: Task, config: TrainConfig, data: Arrays, folder: Path) -> Progress:
    """Trains, or goes on from the folder's latest checkpoint; writes `network.npz`.

    Reports "training" after every epoch, with the `Progress` as the partial result. Cancelled or
    interrupted, it leaves a checkpoint of the last whole epoch.
    """
    fresh, held_out = split(data, config)
    network = task.network(config.seed, fresh)
    structure, learned, constant = nnx.split(network, nnx.Param, ...)
    adam = optax.scale_by_adam()
    run_epoch, validate = _compile(task, structure, constant, adam, config)
    state = State(learned, learned, adam.init(learned))
    progress = Progress(0, config.learning_rate, float("inf"), 0, 0, ())
    if restored := load_checkpoint(folder, state, config):
        state, progress = restored
    fresh_on_device = {name: jnp.asarray(values) for name, values in fresh.items()}
    held_on_device = {name: jnp.asarray(values) for name, values in held_out.items()}
    saved, saved_s = progress.epoch, time.monotonic()
    try:
        while not is_done(progress, config):
            key = jax.random.fold_in(jax.random.key(config.seed), progress.epoch)
            rate = jnp.float32(progress.learning_rate)
            weights, moments, loss = run_epoch(
                state.weights, state.moments, rate, key, fresh_on_device
            )
            validation = float(validate(weights, held_on_device))
            state, progress = _after_epoch(
                State(weights, state.best_weights, moments),
                progress,
                float(loss),
                validation,
                config,
            )
            report("training", progress.epoch / config.max_epochs, progress)
            if time.monotonic() - saved_s > SAVE_EVERY_S:
                save_checkpoint(folder, state, progress, config)
                saved, saved_s = progress.epoch, time.monotonic()
    finally:
        if progress.epoch != saved:
            save_checkpoint(folder, state, progress, config)
    best = nnx.state(nnx.merge(structure, state.best_weights, constant))
    save_network(folder / NETWORK, best, config)
    return progress


def is_done(progress: Progress, config: TrainConfig) -> bool:
    """Whether the last plateau or the last epoch is reached."""
    return progress.cuts > config.cuts or progress.epoch >= config.max_epochs


def cosine_rate(epoch: int, config: TrainConfig) -> float:
    """The rate of an epoch, counted from 0, with schedule "cosine"."""
    hold = config.max_epochs / 3
    share = max(0.0, (epoch - hold) / (config.max_epochs - hold))
    return config.learning_rate * 0.5 * (1 + math.cos(math.pi * share))


def split(data: Arrays, config: TrainConfig) -> tuple[Arrays, Arrays]:
    """Training and validation samples."""
    count = round(config.samples * (1 - config.validation_share))
    return (
        {name: values[:count] for name, values in data.items()},
        {name: values[count:] for name, values in data.items()},
    )


def _after_epoch(
    state: State, progress: Progress, loss: float, validation: float, config: TrainConfig
) -> tuple[State, Progress]:
    progress = progress._replace(
        epoch=progress.epoch + 1, losses=(*progress.losses, (loss, validation))
    )
    if config.schedule == "cosine":
        progress = progress._replace(learning_rate=cosine_rate(progress.epoch, config))
    if validation < progress.best:
        return state._replace(best_weights=state.weights), progress._replace(
            best=validation, stale=0
        )
    progress = progress._replace(stale=progress.stale + 1)
    if progress.stale < config.patience or config.schedule == "cosine":
        return state, progress
    return state._replace(weights=state.best_weights), progress._replace(
        learning_rate=progress.learning_rate * config.cut, stale=0, cuts=progress.cuts + 1
    )


def _compile(
    task: Task,
    structure: Any,
    constant: Any,
    adam: optax.GradientTransformation,
    config: TrainConfig,
):
    """Two compiled functions: one epoch, and the validation loss."""

    def loss(weights: Any, batch: dict[str, jax.Array]) -> jax.Array:
        return task.loss(nnx.merge(structure, weights, constant), batch)

    @jax.jit
    def run_epoch(weights, moments, rate, key, data):
        count = len(next(iter(data.values())))
        steps = count // config.batch
        order = jax.random.permutation(key, count)[: steps * config.batch]

        def step(carry, chosen):
            weights, moments = carry
            batch = {name: values[chosen] for name, values in data.items()}
            value, slope = jax.value_and_grad(loss)(weights, batch)
            update, moments = adam.update(slope, moments)
            weights = jax.tree.map(lambda w, u: w - rate * u, weights, update)
            return (weights, moments), value

        (weights, moments), losses = jax.lax.scan(
            step, (weights, moments), order.reshape(steps, config.batch)
        )
        return weights, moments, losses.mean()

    @jax.jit
    def validate(weights, data):
        count = len(next(iter(data.values())))
        parts = max(1, count // 1000)
        size = count // parts
        batches = {n: v[: parts * size].reshape(parts, size, *v.shape[1:]) for n, v in data.items()}
        return jax.lax.map(lambda batch: loss(weights, batch), batches).mean()

    return run_epoch, validate
