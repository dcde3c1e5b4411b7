"""A hash of everything that determines the sampled posterior.

A checkpoint with another hash is refused.
"""

import hashlib
import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from galileo_jax import __version__
from galileo_jax.inference.joint_problem import JointProblem
from galileo_jax.measurement.measure import Measurement
from galileo_jax.runtime.errors import InputError


def identity_of(
    measured: Sequence[Measurement],
    problem: JointProblem,
    *,
    effects_from: Sequence[str | Path],
    options: Sequence[Any],
) -> str:
    """A hash of the data, the model and the options of the chains.

    `measured`: the clips. `effects_from`: files that its effects come from. `options`: whatever
    else decides which chain is drawn; what JSON can hold.

    Raises:
      InputError: a file of `effects_from` has gone since it was run.
    """
    digest = hashlib.sha256()
    for one in measured:
        seen = one.observation
        modes = () if seen.modes_m is None else (seen.modes_m,)
        for array in (seen.times_s, seen.position_m, seen.covariance_m2, seen.mask, *modes):
            digest.update(np.ascontiguousarray(array).tobytes())
        where = {"path", "source", "video", "track"}
        digest.update(one.clip.model_dump_json(exclude=where).encode())
    for path in effects_from:
        try:
            source = Path(path).read_bytes()
        except OSError as error:
            raise InputError(f"effects from {path}: {error.strerror or error}") from error
        digest.update(hashlib.sha256(source).digest())
    # Laws and priors may change with the package, and with others that bring effects.
    model = [__version__, problem.problems[0].engine.name, repr(problem.parameters)]
    model += [problem.problems[0].model.motion]
    digest.update(json.dumps(model + list(options)).encode())
    return digest.hexdigest()
