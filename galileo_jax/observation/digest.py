"""What tells one track from another."""

import hashlib
import json

import numpy as np

from galileo_jax.observation.observation import Observation


def digest(observation: Observation) -> str:
    """A hash of names, times, which points were seen and where; 16 hexadecimal digits."""
    found = hashlib.sha256(json.dumps(observation.names).encode())
    seen = np.where(observation.mask[:, None], observation.position_m, 0.0)
    for array in (observation.times_s, seen, observation.mask):
        found.update(np.ascontiguousarray(array).tobytes())
    return found.hexdigest()[:16]
