"""A stopped sampling on disk: everything needed to go on as if it had never stopped."""

import hashlib
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple, TypeVar
from zipfile import BadZipFile

import jax
import numpy as np

from galileo_jax.runtime.atomic_write import replacing
from galileo_jax.runtime.errors import InputError

Carry = TypeVar("Carry")


class History(NamedTuple):
    """All steps so far, warm-up first: arrays with leading axes `[chain, step]`."""

    position: np.ndarray
    log_density: np.ndarray
    is_accepted: np.ndarray

    @property
    def num_steps(self) -> int:
        """Steps made so far."""
        return self.position.shape[1]

    def extended(self, other: "History") -> "History":
        """This history followed by `other`."""
        return History(
            *(np.concatenate([a, np.asarray(b)], axis=1) for a, b in zip(self, other, strict=True))
        )


def fingerprint(parts: Sequence[object]) -> str:
    """A digest of what must be the same for a run to be continued."""
    digest = hashlib.sha256()
    for part in parts:
        if isinstance(part, np.ndarray):
            digest.update(f"{part.dtype}{part.shape}".encode())
            digest.update(np.ascontiguousarray(part).tobytes())
        else:
            digest.update(repr(part).encode())
    return digest.hexdigest()


def save(path: Path, digest: str, carry: object, history: History) -> None:
    """Writes the run in one step: an older checkpoint stays until the new one is whole."""
    leaves = {f"carry{i}": np.asarray(leaf) for i, leaf in enumerate(jax.tree.leaves(carry))}
    with replacing(path) as temporary, temporary.open("wb") as file:
        np.savez(file, allow_pickle=False, fingerprint=digest, **leaves, **history._asdict())


def load(path: Path, digest: str, like: Carry) -> tuple[Carry, History]:
    """Reads what `save` wrote; `like` gives the structure of the carry.

    Raises:
      InputError: the file is damaged, or belongs to another key, start, sampler, model or clip.
    """
    try:
        with Path(path).open("rb") as file, np.load(file, allow_pickle=False) as arrays:
            content = dict(arrays)
        found = str(content["fingerprint"])
        history = History(*(content[name] for name in History._fields))
        num_leaves = len(jax.tree.leaves(like))
        leaves = [jax.numpy.asarray(content[f"carry{i}"]) for i in range(num_leaves)]
    except (OSError, ValueError, KeyError, EOFError, BadZipFile) as error:
        raise InputError(f"{path}: not a checkpoint; delete it to start anew") from error
    if found != digest:
        raise InputError(
            f"{path}: belongs to a run with another seed, start, sampler, model or clip; "
            "delete it to start anew"
        )
    return jax.tree.unflatten(jax.tree.structure(like), leaves), history
