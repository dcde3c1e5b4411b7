"""One parameter of an object moved, all else as in a fit.

To where it begins to show or ceases to: rims that grip so well that their slip ends do not tell how
well, and no slope leads from there to where they slip. A disc that slips for an instant tells its
friction; one that never does tells nothing, and moves almost alike. What shows nowhere is left.

Where the fit does not explain the data, a little, too: a valley in which boxes meet again a frame
later than they did may lie beside that in which they do, and all starts have ended there.
"""

import numpy as np

from galileo_jax.inference.fits.descent import BEHIND_IN_SEARCH
from galileo_jax.inference.fits.gradient import GradientFit, GradientFitter
from galileo_jax.inference.joint_problem import JointProblem
from galileo_jax.search.table import CHANGED_NATS, Start, Table

NAME = "nudge"
MOVED_Z = (-1.0, -0.5, 0.5, 1.0)
ELSEWHERE_Z = (-2.0, -1.0, 1.0, 2.0)
FAR_SDS = 8.0  # from a fit that tells a parameter: there it should be far worse (32 nats)
UNTOLD_SD_Z = 0.9  # of the prior's 1: a parameter left so open does not show


def propose(table: Table) -> list[Start]:
    """The fit without rivals, each parameter of its objects moved by itself."""
    if table.most_effects or not table.entries:
        return []
    starts: list[Start] = []
    for one, _ in table.not_asked(NAME, [(table.base, ())]):
        points = elsewhere(table.fitter, one.fit)
        if not table.is_explained(one):
            which, by = _moves(table.trials, one.fit, MOVED_Z)
            z = one.fit.z[: len(one.fit.steps)]
            points = np.concatenate([points, z + by[:, None] * np.eye(len(z))[which]])
        starts += [Start((), z, one, NAME, i, is_near=True) for i, z in enumerate(points)]
    return starts


def elsewhere(fitter: GradientFitter, fit: GradientFit) -> np.ndarray:
    """Where a parameter shows that does not in a fit, or the other way, `[start, z]`."""
    count = len(fit.steps)
    z, sd = fit.z[:count], np.sqrt(np.diag(fit.covariance)[:count])
    which, where = _moves(fitter.trials, fit, ELSEWHERE_Z)
    is_open = sd[which] > UNTOLD_SD_Z
    is_asked = is_open | (np.abs(where - z[which]) > FAR_SDS * sd[which])
    which, where, is_open = (each[is_asked] for each in (which, where, is_open))
    points = np.stack([z, *np.where(np.arange(count) == which[:, None], where[:, None], z)])
    of_prior = 0.5 * np.sum(points**2, axis=1)
    left = fitter.residuals.costs(fit.points(points)) - of_prior
    worse = left[1:] - left[0]
    shows = np.where(is_open, np.abs(worse) > CHANGED_NATS, worse < BEHIND_IN_SEARCH)
    return points[1:][shows]


def _moves(
    trials: JointProblem, fit: GradientFit, each: tuple[float, ...]
) -> tuple[np.ndarray, np.ndarray]:
    """Which of the objects' parameters, and by or to what, in z."""
    is_main = np.array([p.role == "main" for p in trials.model_parameters])
    main = np.flatnonzero(fit.free[: len(is_main)] & is_main)
    return np.repeat(main, len(each)), np.tile(each, len(main))
