"""The one loop that drives every sampler: chains, warm-up, stopping, checkpoints.

    warm-up blocks: Robbins-Monro on the scale within a block; after it, mean and covariance from
        the newer half of the warm-up, pooled over the chains and shrunk towards those before
    sampling blocks: the sampler is frozen; stop when every monitored quantity has
        R-hat < max_rhat and bulk ESS >= min_ess, or after max_steps

The number of evaluations is exactly chains x (1 + steps). With m split chains R-hat - 1 is about
m / (2 ESS) even in equilibrium, so that many chains make R-hat < 1.01 dear: eight chains need about
800 effective draws.
"""

import dataclasses
import signal
import threading
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from galileo_jax.inference.convergence import Convergence, convergences, effective
from galileo_jax.inference.posterior import Posterior, Status
from galileo_jax.inference.samplers import checkpoint as checkpoints
from galileo_jax.inference.samplers.checkpoint import History
from galileo_jax.inference.samplers.program import compiled
from galileo_jax.inference.samplers.sampler import AbstractSampler, LogDensity, TunedSampler

GAIN_EXPONENT = 0.6
"""Robbins-Monro gains (t + 1)^-0.6: slow enough to get there, fast enough to settle."""

PRIOR_DRAWS_PER_DIMENSION = 5
"""What the covariance before a refit weighs against the effective draws of the window."""


@dataclass(frozen=True)
class Settings:
    """How long to sample."""

    # per chain, discarded; the sampler is tuned after each block of them; 200 with eight chains
    # mend a covariance that is wrong by a factor of four
    warmup_steps: int = 200
    # per chain, between two looks at convergence, two checkpoints and two reports, whole turns of
    # the sampler; a Ctrl-C takes effect at the end of a block
    block_steps: int = 25
    max_steps: int = 4000  # per chain, after the warm-up, where convergence does not come before
    max_rhat: float = 1.01  # stop when R-hat of every monitored quantity is below
    min_ess: float = 400.0  # and its bulk effective sample size is at least this
    stops_early: bool = True  # False runs `max_steps`, whatever the diagnostics say

    def __post_init__(self) -> None:
        for name in ("block_steps", "max_steps"):
            if getattr(self, name) < 1:
                raise ValueError(f"{name} is {getattr(self, name)}; it must be at least 1")
        for name in ("warmup_steps", "max_steps"):
            if getattr(self, name) % self.block_steps:
                raise ValueError(
                    f"{name} is {getattr(self, name)}, not a multiple of "
                    f"block_steps {self.block_steps}"
                )


@dataclass(frozen=True)
class Progress:
    """What a progress bar needs, after each block."""

    # per chain, warm-up included
    num_steps: int
    max_steps: int
    is_warmup: bool  # True while the sampler is still being tuned
    acceptance_rate: float  # of the latest block
    # of the monitored quantities at the latest look; empty in the warm-up
    convergence: Mapping[str, Convergence]


def sample(
    key: jax.Array,
    sampler: AbstractSampler,
    log_density: LogDensity,
    start: jax.Array,
    names: Sequence[str],
    *,
    settings: Settings = Settings(),
    monitor: Callable[[np.ndarray], Mapping[str, np.ndarray]] | None = None,
    on_block: Callable[[Progress], None] | None = None,
    checkpoint: Path | None = None,
    identity: str = "",
) -> Posterior:
    """The posterior exp(log_density) by draws; `status` says whether they converged.

    Arguments:
      key: the only source of randomness; the same key gives the same draws.
      sampler: tuned in the warm-up where it is a `TunedSampler`.
      log_density: `[dim] -> []`, vmapped over the chains (one call per turn for all).
      start: `[chain, dim]`, wider than the density, so that R-hat sees chains that have not met.
      names: of the `dim` coordinates.
      settings: how long.
      monitor: draws `[chain, draw, dim]` to the quantities `[chain, draw]` that must
        converge: the identified ones. Default: every coordinate.
      on_block: called after each block.
      checkpoint: a file, written after each block; where it exists already the run goes
        on from there and ends with the draws of an undisturbed run. Left in place.
      identity: what the log density stands for (clips, effects, options); a checkpoint
        of another identity is refused.

    Raises:
      ValueError: shapes do not fit, or the log density is not finite at a start.
      InputError: the checkpoint belongs to another run, or is damaged.
    """
    start, per_turn = jnp.asarray(start), sampler.steps_per_turn
    if start.ndim != 2 or start.shape[1] != len(names):
        raise ValueError(f"start {start.shape} is not [chain, {len(names)}]")
    if settings.block_steps % per_turn:
        raise ValueError(
            f"block_steps is {settings.block_steps}; {sampler.name} "
            f"makes {per_turn} steps at a time"
        )
    monitor = monitor or (lambda draws: dict(zip(names, np.moveaxis(draws, -1, 0), strict=True)))
    identity = checkpoints.fingerprint(
        [
            np.asarray(jax.random.key_data(key)),
            *(np.asarray(leaf) for leaf in jax.tree.leaves(sampler)),
            np.asarray(start),
            sampler.name,
            tuple(names),
            (settings.warmup_steps, settings.block_steps),
            identity,
        ]
    )
    states, sampler, history = _begun(sampler, log_density, start, checkpoint, identity)
    warmup, total = settings.warmup_steps, settings.warmup_steps + settings.max_steps
    state = dict[str, Convergence]()
    if _is_due(history, settings):
        state = convergences(monitor(history.position[:, warmup:]))
    while history.num_steps < total and not _is_enough(state, settings):
        with _interrupt_deferred():
            done, is_warmup = history.num_steps, history.num_steps < warmup
            turns = jnp.arange(done, done + settings.block_steps, sampler.steps_per_turn)
            gains = is_warmup * (jnp.arange(len(turns)) + 1.0) ** -GAIN_EXPONENT
            arrays = (log_density, sampler, jax.random.key_data(key), states, turns, gains)
            states, sampler, record = compiled(_run_block, (states, sampler, (0, 0, 0)), *arrays)
            block = History(*(np.asarray(leaf) for leaf in record))
            history = history.extended(block)
            if is_warmup and isinstance(sampler, TunedSampler):
                sampler = _refitted(sampler, history)
            if checkpoint is not None:
                checkpoints.save(Path(checkpoint), identity, (states, sampler), history)
        if _is_due(history, settings):
            state = convergences(monitor(history.position[:, warmup:]))
        if on_block is not None:
            accepted = float(block.is_accepted.mean())
            on_block(Progress(history.num_steps, total, is_warmup, accepted, state))
    return _posterior(key, sampler, history, names, settings, state)


def _begun(
    sampler: AbstractSampler,
    log_density: LogDensity,
    start: jax.Array,
    checkpoint: Path | None,
    identity: str,
) -> tuple[Any, AbstractSampler, History]:
    """The chains' states, the sampler and the draws so far: of a checkpoint that is there, or none.

    Raises as `sample`.
    """
    shapes = eqx.filter_eval_shape(_states_at, jnp.sum, sampler, start)  # without an evaluation
    if checkpoint is not None and Path(checkpoint).exists():
        (states, sampler), history = checkpoints.load(checkpoint, identity, (shapes, sampler))
        return states, sampler, history
    states = compiled(_states_at, shapes, log_density, sampler, start)
    found = np.asarray(states.log_density)
    bad = np.flatnonzero(~np.isfinite(found))
    if bad.size:
        raise ValueError(
            f"the log density is {found[bad[0]]} at the start of chain {bad[0]} "
            f"({bad.size} of {found.size} chains); start where it is finite"
        )
    none = np.zeros((len(found), 0), found.dtype)
    position = np.zeros((len(found), 0, start.shape[1]), start.dtype)
    return states, sampler, History(position, none, none.astype(bool))


def _states_at(log_density: LogDensity, sampler: AbstractSampler, start: jax.Array) -> Any:
    return jax.vmap(lambda position: sampler.init(position, log_density))(start)


def _run_block(
    log_density: LogDensity,
    sampler: AbstractSampler,
    key_data: jax.Array,
    states: Any,
    turns: jax.Array,
    gains: jax.Array,
) -> tuple[Any, AbstractSampler, tuple[jax.Array, ...]]:
    """One block of all chains, compiled once: in the sampling phase the gains are zero.

    Returns the states, the sampler and the leaves of the block's `History`.
    """
    num_chains = states.log_density.shape[0]
    key = jax.random.wrap_key_data(key_data)

    def body(carry, turn_and_gain):
        states, sampler = carry
        first_step, gain = turn_and_gain
        # Keys follow from the step's number, so that a resumed run needs no stored key.
        keys = jax.random.split(jax.random.fold_in(key, first_step), num_chains)
        states, (trace, info) = jax.vmap(lambda k, s: sampler.turn(k, s, log_density))(keys, states)
        if isinstance(sampler, TunedSampler):
            sampler = sampler.rescaled(info, gain)
        return (states, sampler), (trace.position, trace.log_density, info.is_accepted)

    (states, sampler), record = jax.lax.scan(body, (states, sampler), (turns, gains))
    # From [turn, chain, step of the turn, ...] to [chain, step, ...].
    by_chain = (jnp.moveaxis(leaf, 0, 1) for leaf in record)
    return states, sampler, tuple(v.reshape(len(v), -1, *v.shape[3:]) for v in by_chain)


def _refitted(sampler: TunedSampler, history: History) -> TunedSampler:
    """Mean and covariance of the newer half, shrunk towards the sampler's own covariance.

    The window counts with its effective draws, the covariance before it with five per
    dimension: a window of one stuck chain changes nothing, a good one nearly everything.
    """
    window = history.position[:, history.num_steps // 2 :].astype(np.float64)
    dim = window.shape[-1]
    count = min(effective(window[..., i]) for i in range(dim))
    if not np.isfinite(count):
        return sampler
    flat = window.reshape(-1, dim)
    prior = PRIOR_DRAWS_PER_DIMENSION * dim
    before = np.asarray(sampler.covariance, np.float64)
    covariance = (prior * before + count * np.cov(flat, rowvar=False)) / (prior + count)
    return sampler.fitted(jnp.asarray(flat.mean(axis=0)), jnp.asarray(covariance))


def _is_due(history: History, settings: Settings) -> bool:
    """Diagnostics cost as much as tens of steps: look when a tenth has come on top."""
    blocks = (history.num_steps - settings.warmup_steps) // settings.block_steps
    look = 1
    while look < blocks:
        look = max(look + 1, look + look // 10)
    return settings.stops_early and look == blocks


def _is_enough(state: Mapping[str, Convergence], settings: Settings) -> bool:
    # Written so that a NaN (nothing moved) is not enough.
    return bool(state) and all(
        c.rhat < settings.max_rhat and c.ess_bulk >= settings.min_ess for c in state.values()
    )


def _posterior(
    key: jax.Array,
    sampler: AbstractSampler,
    history: History,
    names: Sequence[str],
    settings: Settings,
    state: Mapping[str, Convergence],
) -> Posterior:
    sampled = History(*(leaf[:, settings.warmup_steps :] for leaf in history))
    if not settings.stops_early:
        status = Status.FIXED_LENGTH
    elif _is_enough(state, settings):
        status = Status.CONVERGED
    elif not sampled.is_accepted.any(axis=1).all():
        status = Status.STUCK_CHAIN
    else:
        status = Status.STEP_LIMIT
    num_chains = history.position.shape[0]
    return Posterior(
        names=tuple(names),
        draws=sampled.position,
        log_density=sampled.log_density,
        status=status,
        stats={
            "num_chains": num_chains,
            "num_steps": history.num_steps,
            "num_evaluations": num_chains * (1 + history.num_steps),
            "acceptance_rate": float(sampled.is_accepted.mean()),
        },
        provenance={
            "sampler": sampler.name,
            "settings": dataclasses.asdict(settings),
            "key": np.asarray(jax.random.key_data(key)).tolist(),
            "jax": jax.__version__,
        },
    )


@contextmanager
def _interrupt_deferred() -> Iterator[None]:
    """Holds a Ctrl-C back until the block and its checkpoint are done.

    A KeyboardInterrupt inside a compiled loop or its callback would come back as a runtime
    error of XLA. Outside the main thread there is nothing to hold back.
    """
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    received = []
    before = signal.signal(signal.SIGINT, lambda *_: received.append(True))
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, before)
    if received:
        raise KeyboardInterrupt
