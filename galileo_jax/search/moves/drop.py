"""One effect less, all else making up for it as far as it can.

An effect may lead not because it is there but because its fit came to a valley that the fit without
it missed: boxes that part after a hit and meet again have one for every order of their touches,
and a nuisance reaches the same motion as an effect of the same kind. With J_e the slope of the
residuals with the effect's strength s, and J that with the others,

    dz = (J^T J + 1)^-1 J^T J_e s.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from galileo_jax.inference.fits.gradient import GradientFit, GradientFitter
from galileo_jax.inference.joint_problem import JointProblem
from galileo_jax.model.parameters import in_units
from galileo_jax.numerics.normal_matrix import inverse
from galileo_jax.search.hypothesis import Hypothesis, reduced
from galileo_jax.search.starts import positive_nuisances
from galileo_jax.search.table import Start, Table

NAME = "drop"
NUM_LEADERS = 3
ALONG_Z = np.linspace(-2.0, 2.5, 19)  # of a positive nuisance: where another valley may begin
LEAD_NATS = 3.0  # by which the evidence without it is behind: less needs no better fit
STEP_Z = 1e-4


def propose(table: Table) -> list[Start]:
    """The leading hypotheses without one of their effects: as they are, and made up for."""
    starts: list[Start] = []
    for leader in table.leaders(NUM_LEADERS):
        wanted = [(leader, tuple(n for n in leader.effects if n != one)) for one in leader.effects]
        for _, kept in table.not_asked(NAME, wanted):
            known = table.entries.get(frozenset(kept))
            behind = leader.fit.log_evidence - LEAD_NATS
            if known is None or known.hypothesis.fit.log_evidence > behind:
                continue
            made_up = without_effects(table.trials, leader, kept)
            points = along_nuisances(table.fitter, made_up)
            if kept:
                points = np.stack([reduced(table.trials, leader, kept).fit.z[: len(points[0])]])
            starts += [Start(kept, z, leader, NAME, i, not kept) for i, z in enumerate(points)]
    return starts


def along_nuisances(fitter: GradientFitter, fit: GradientFit) -> np.ndarray:
    """Where chi2 is least as one positive nuisance moves, all else as in a fit, `[start, z]`.

    Every minimum of every line, the fit's own noise; the lines' ends, too.
    """
    z = fit.z[: len(fit.steps)]
    own = positive_nuisances(fitter.trials, fit.free)
    points = np.tile(z, (len(own), len(ALONG_Z), 1))
    points[np.arange(len(own)), :, own] = ALONG_Z
    costs = fitter.residuals.costs(fit.points(points.reshape(-1, len(z))))
    costs = costs.reshape(points.shape[:2])
    beside = np.pad(costs, ((0, 0), (1, 1)), constant_values=np.inf)
    is_least = (costs <= beside[:, :-2]) & (costs <= beside[:, 2:])
    return np.concatenate([z[None], points[is_least]])


def without_effects(
    trials: JointProblem, hypothesis: Hypothesis, kept: Sequence[str] = ()
) -> GradientFit:
    """A fit's other parameters where they make up for effects: to start from, not a fit."""
    fit, count = hypothesis.fit, len(trials.model_parameters)
    start = reduced(trials, hypothesis, kept).fit
    others = start.free[:count]
    slope = np.zeros(len(fit.jacobian))
    for i in np.flatnonzero(fit.free[:count] & ~others):
        parameter, z = trials.model_parameters[i], float(fit.z[i])
        if parameter.absent == 0.0:  # a strength; places and lengths go with it
            value, ahead = (float(in_units(parameter.prior, at)) for at in (z, z + STEP_Z))
            if ahead != value:
                slope += fit.jacobian[:, i] * (value * STEP_Z / (ahead - value))
    jacobian = fit.jacobian[:, :count][:, others]
    moved = start.z.copy()
    moved[:count][others] += inverse(jacobian.T @ jacobian + np.eye(jacobian.shape[1])) @ (
        jacobian.T @ slope
    )
    return replace(start, z=moved)
