"""Positive nuisances moved across their valleys, all else as in a fit.

A small coefficient of restitution decides whether bodies part and meet again, so that the misfit
has a valley on either side. No slope leads over the rim.
"""

import numpy as np

from galileo_jax.inference.fits.gradient import GradientFit
from galileo_jax.inference.joint_problem import JointProblem
from galileo_jax.search.starts import positive_nuisances
from galileo_jax.search.table import BASE, Start, Table

NAME = "jolt"
MOST_JOLTED = 6  # those that the loop refines with care
VARIANTS_Z = (-2.0, -0.5, 1.0)  # hardly any, a little, a lot; from every fit
CROSSED_Z = (-3.0, 1.0)  # one of them next to nothing, the others a lot


def propose(table: Table) -> list[Start]:
    """Of the hypotheses that may decide, the fit with hardly any, a little and a lot of all.

    Of a fit without rivals each is moved alone as well, and against the others: bodies that leave
    a gap need not be those that rebound little.
    """
    is_alone = table.most_effects == 0
    keys = table.entries if is_alone else [key for key in table.deciding() if key != BASE]
    rows = [table.entries[key].hypothesis for key in keys]
    wanted = table.not_asked(NAME, [(one, one.effects) for one in rows[:MOST_JOLTED]])
    return [
        Start(one.effects, z, one, NAME, number, is_near=True)
        for one, _ in wanted
        for number, z in enumerate(jolted(table.trials, one.fit, is_alone))
    ]


def jolted(trials: JointProblem, fit: GradientFit, with_each: bool) -> list[np.ndarray]:
    """Z of the model's parameters, the nuisances moved together; `with_each`: and one by one."""
    z, own = fit.z[: len(fit.steps)], positive_nuisances(trials, fit.free)
    if not len(own):
        return []
    each = np.eye(len(z), dtype=bool)[own]
    every, (little, lot) = each.any(axis=0), CROSSED_Z
    found = [np.where(every, other, z) for other in VARIANTS_Z]
    if with_each and len(own) > 1:
        found += [np.where(one, other, z) for one in each for other in VARIANTS_Z]
        found += [np.where(one, little, np.where(every, lot, z)) for one in each]
    return found
