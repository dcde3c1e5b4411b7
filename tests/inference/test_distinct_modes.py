"""Which valleys stand beside the best one."""

from dataclasses import replace

import numpy as np

from galileo_jax.inference.fits.gradient import Code, GradientFit, apart

FIT = GradientFit(
    z=np.zeros(3), free=np.array([True, True, False]), covariance=np.diag([0.01, 1.0, 0.0]),
    chi2=0.0, log_evidence=-100.0, num_values=9, steps=np.ones(2), jacobian=np.zeros((9, 2)),
    code=Code.CONVERGED, stats={}, pull=0.0, num_pulled=0.0,
)  # fmt: skip


def at(z, log_evidence):
    return replace(FIT, z=np.array(z), log_evidence=log_evidence)


def test_valleys_apart_the_best_first_and_none_twice():
    best, same = at([0.0, 0.0, 0.0], -90.0), at([0.05, 0.5, 0.0], -90.1)
    other, behind = at([1.0, 0.0, 0.0], -91.0), at([-1.0, 0.0, 0.0], -93.5)
    assert apart([other, behind, same, best]) == [best, other]
