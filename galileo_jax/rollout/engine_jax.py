"""What the engines written in JAX share: batches, lengths, and compiled programs."""

import functools
from collections.abc import Callable
from typing import Any, ClassVar

import jax
import numpy as np
from jax.sharding import Mesh, PartitionSpec
from jaxtyping import Float

from galileo_jax.model.effects.effect import Effect, Surroundings
from galileo_jax.model.model import Model
from galileo_jax.rollout.acting_laws import ActingLaws, Share
from galileo_jax.rollout.events import Motion, RollOut
from galileo_jax.runtime.batching import MOTIONS, in_chunks, rounded_up
from galileo_jax.runtime.batching import RECORDS as LONG
from galileo_jax.runtime.device_cache import OnDevice
from galileo_jax.runtime.trace_cache import trace_cached

RECORDS = 128  # rollouts' lengths are rounded up to multiples, so that clips share programs
SPARE = 3  # records beyond the last time: between two of them a place is interpolated


class EngineJax:
    """Simulates batches of parameter vectors; compiled once for all clips of a kind."""

    name = "rigid"
    roll_out: ClassVar[RollOut]  # of one parameter vector

    def __init__(
        self,
        model: Model,
        laws: ActingLaws | None = None,
        surroundings: Surroundings | None = None,
    ):
        self.model = model
        self._laws = ActingLaws(model) if laws is None else laws
        self._scene = model.scene.surroundings if surroundings is None else surroundings
        self._surroundings = OnDevice(self._scene)

    def simulate(
        self, theta: Float[np.ndarray, "batch parameter"]
    ) -> tuple[np.ndarray, np.ndarray]:
        """As `EngineC.simulate`: centres and velocities `[batch, object, 2, record + 1]`."""
        count = self.model.num_records + 1
        always = np.full(len(theta), np.inf)
        position, velocity = self.each(theta, always, lambda _, *motion: motion)
        return position[..., :count], velocity[..., :count]

    def each(
        self,
        theta: Float[np.ndarray, "batch parameter"],
        until_s: Float[np.ndarray, " batch"],
        then: Callable[..., Any],
        *rows: np.ndarray,
    ) -> Any:
        """What follows from each motion: motions themselves are large, and stay where they are.

        Args:
          theta: as of `simulate`.
          until_s: when somebody looks for the last time: later, objects may be anywhere.
          then: maps parts of a batch, `(theta, position, velocity, *rows)`, each `[part, ...]`, to
            a PyTree of arrays `[part, ...]`.
          *rows: more arguments of `then`, `[batch, ...]`.

        Returns:
          What `then` of the whole batch would, as NumPy arrays.
        """
        theta = np.asarray(theta)
        shares = self._laws.shares(theta)

        def parts(share: Share, theta: np.ndarray, until_s: np.ndarray, *rows: np.ndarray) -> Any:
            return then(theta, *self._as_long_as_needed(share, theta, until_s), *rows)

        found = [
            in_chunks(
                MOTIONS,
                functools.partial(parts, share),
                *(values[own] for values in (theta, until_s, *rows)),
            )
            for share, own in shares
        ]
        if len(shares) == 1 and (np.diff(shares[0][1]) == 1).all():
            return found[0]  # nothing was moved, and nothing need be copied

        def together(*leaves: np.ndarray) -> np.ndarray:
            whole = np.empty((len(theta), *leaves[0].shape[1:]), leaves[0].dtype)
            for (_, own), leaf in zip(shares, leaves, strict=True):
                whole[own] = leaf
            return whole

        return jax.tree.map(together, *found)

    def _as_long_as_needed(self, share: Share, theta: np.ndarray, until_s: np.ndarray) -> Motion:
        """Rolled out until the last time of all that is asked for."""
        model = self.model
        most = model.num_records + 1
        last = float(np.max(np.nan_to_num(until_s, nan=np.inf), initial=0.0))
        count = int(min(last / model.record_dt_s + SPARE, most))
        return _roll_out_batch(
            self.roll_out,
            share.effects,
            share.names,
            rounded_up(most, LONG),
            model.record_dt_s,
            share.of(theta),
            self._surroundings(),
            np.asarray(count),
            share.acts(theta),
        )

    def traceable(self, theta: Float[jax.Array, "batch parameter"]) -> Motion:
        """`simulate` in JAX: can be jitted, vmapped and differentiated."""
        model = self.model
        count = model.num_records + 1
        position, velocity = _roll_out_batch(
            self.roll_out,
            model.effects + model.nuisances,
            model.names,
            rounded_up(count, RECORDS),
            model.record_dt_s,
            theta,
            self._scene,
        )
        return position[..., :count], velocity[..., :count]


@trace_cached(num_static=5)
def _roll_out_batch(
    roll_out: RollOut,
    effects: tuple[Effect, ...],
    names: tuple[str, ...],
    num_records: int,
    dt_s: float,
    theta: jax.Array,
    scene: Surroundings,
    count: Any = None,
    acts: Any = None,
) -> Motion:
    def one(theta: jax.Array, shared: tuple[Surroundings, Any, Any]) -> Motion:
        return roll_out(effects, names, num_records, dt_s, theta, *shared)

    return _over_devices(jax.vmap(one, (0, None)), theta.shape[0])(theta, (scene, count, acts))


def _over_devices(function: Callable[..., Any], num_rows: int) -> Callable[..., Any]:
    """`function` of a batch `[row, ...]` and what all share, its rows spread over the devices.

    Each device works off its own part: a loop that ends early in one waits for no other. `function`
    itself where there is one device, or where the rows cannot be shared out evenly.
    """
    devices = jax.local_devices()
    if len(devices) == 1 or num_rows % len(devices):
        return function
    rows, mesh = PartitionSpec("row"), Mesh(np.array(devices), ("row",))
    return jax.shard_map(
        function, mesh=mesh, in_specs=(rows, PartitionSpec()), out_specs=rows, check_vma=False
    )
