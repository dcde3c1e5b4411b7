"""Model error: how much real bodies differ from ideal rigid ones, added to every posterior.

Faces are not exactly square and friction is not exactly constant. The impulse of a hit is taken to
be known to a few tenths of a per cent, friction to half a per cent after the hit and to 1e-4 before
it. Chosen in view of the clips in docs/explanation/benchmarks.md, whose tracking is good to
hundredths of a pixel; an interval from the likelihood alone would there be too narrow.
"""

import re
from itertools import pairwise

import numpy as np

IMPULSE_SD = 0.003
FRICTION_AFTER_HIT_SD = 0.006
FRICTION_SD = 1e-4
# Of a mass's logarithm: a hit that hardly slows object 1 says nothing of how heavy it is.
MOST_OF_A_MASS = 1.0


def add_model_error(draws: np.ndarray, names: tuple[str, ...], seed: int) -> np.ndarray:
    """Widens draws `[..., parameter]` (in the parameters' units) by the simulator's own errors.

    A plastic hit gives v' = v R / (1 + R), R = m1 / m2, so that a relative error d of the
    impulse is one of (1 + R) d of the mass ratio; it is shared out evenly between the masses
    before and behind it.
    """
    generator = np.random.default_rng([seed, 20])
    widened = draws.copy()
    if "k1" in names:
        k1 = names.index("k1")
        allowed = FRICTION_SD * generator.standard_normal(draws.shape[:-1])
        widened[..., k1] = np.clip(draws[..., k1] + allowed, 1e-9, 1 - 1e-9)
    masses = [i for i, name in enumerate(names) if re.fullmatch(r"m\d+", name)]
    for number, (one, other) in enumerate(pairwise(masses), 2):
        ratio = draws[..., one] / draws[..., other]
        normal = generator.standard_normal((2, *draws.shape[:-1]))
        factor = np.exp(np.minimum(0.5 * IMPULSE_SD * (1 + ratio), MOST_OF_A_MASS) * normal[0])
        # Only this ratio changes: those on either side of it keep theirs.
        for mass in masses:
            widened[..., mass] *= factor if mass <= one else 1 / factor
        k = names.index(f"k{number}")
        spread = np.exp(FRICTION_AFTER_HIT_SD * normal[1])
        widened[..., k] = np.minimum(draws[..., k] * spread, 1.0 - 1e-9)
    return widened
