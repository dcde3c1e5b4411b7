"""What the simulator itself does not know, added to every posterior.

Compliant contacts give the impulse of a rigid plastic hit within about half a per cent, and
what object 2 then loses to friction within some 1.5 per cent (tests/rollout compares with the
closed form). A camera that sees hundredths of a pixel measures better than that, and an
interval from the likelihood alone would be too narrow. k1 gets 1e-4,
chosen in view of the clips in docs/benchmarks.md; in the first third of a second, while the
contact settles, benchmarks/contact.py finds up to 4e-4.
"""

import numpy as np

IMPULSE_SD = 0.005
FRICTION_AFTER_HIT_SD = 0.015
FRICTION_SD = 1e-4


def add_model_error(draws: np.ndarray, names: tuple[str, ...], seed: int) -> np.ndarray:
    """Widens draws `[..., parameter]` (in the parameters' units) by the simulator's own errors.

    A plastic hit gives v' = v R / (1 + R), R = m1 / m2, so that a relative error d of the
    impulse is one of (1 + R) d of the mass ratio; it is shared out evenly between the masses.
    """
    generator = np.random.default_rng([seed, 20])
    widened = draws.copy()
    if "k1" in names:
        k1 = names.index("k1")
        allowed = FRICTION_SD * generator.standard_normal(draws.shape[:-1])
        widened[..., k1] = np.clip(draws[..., k1] + allowed, 1e-9, 1 - 1e-9)
    if "m2" not in names:
        return widened
    m1, m2, k2 = names.index("m1"), names.index("m2"), names.index("k2")
    ratio = draws[..., m1] / draws[..., m2]
    normal = generator.standard_normal((2, *draws.shape[:-1]))
    factor = np.exp(0.5 * IMPULSE_SD * (1 + ratio) * normal[0])
    widened[..., m1] *= factor
    widened[..., m2] /= factor
    spread = np.exp(FRICTION_AFTER_HIT_SD * normal[1])
    widened[..., k2] = np.minimum(draws[..., k2] * spread, 1.0 - 1e-9)
    return widened
