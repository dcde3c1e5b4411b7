"""Another effect in place of one, with its place, time or length.

What acts in one place is met by few starts. Where it is known, only the strength is to be found.
"""

from dataclasses import replace

import numpy as np

from galileo_jax.inference.joint_problem import JointProblem
from galileo_jax.model.parameters import in_units
from galileo_jax.search.hypothesis import Hypothesis
from galileo_jax.search.score_tests import strength_of
from galileo_jax.search.starts import best_strengths
from galileo_jax.search.table import Start, Table

NAME = "copy_shape"
NUM_LEADERS = 2


def propose(table: Table) -> list[Start]:
    """The leading hypotheses with another effect that has the same kind of shape."""
    trials, starts = table.trials, list[Start]()
    for leader, one, parent, effects in table.replacements(NUM_LEADERS):
        z = with_shape_of(trials, leader, one, effects[-1])
        if z is not None and table.not_asked(NAME, [(parent, effects)]):
            starts.append(Start(effects, z, parent, NAME))
    if not starts:
        return []
    free = table.free([start.effects for start in starts])
    z = np.where(free, np.stack([start.z for start in starts]), 0.0)
    where = [strength_of(trials, start.effects[-1])[0] for start in starts]
    best = best_strengths(table.fitter, z, free, where)
    return [replace(start, z=own) for start, own in zip(starts, best, strict=True)]


def with_shape_of(
    trials: JointProblem, leader: Hypothesis, effect: str, other: str
) -> np.ndarray | None:
    """The leader's parameters, `[model parameter]`, z, with the shape of its effect in another's.

    The same value in SI units; None where they have no kind of shape in common.
    """
    parameters, own = trials.model_parameters, shape_of(trials, other)
    z = leader.fit.z[: len(parameters)].copy()
    same = [(own[end], i) for end, i in shape_of(trials, effect).items() if end in own]
    for mine, its in same:
        value = in_units(parameters[its].prior, leader.fit.z[its])
        z[mine] = parameters[mine].prior.inverse(value)
    return z if same else None


def shape_of(trials: JointProblem, effect: str) -> dict[str, int]:
    """Where an effect's parameters stand beside its strength, by how their names end."""
    named = {trials.model_parameters[i].name: int(i) for i in trials.brought_by(effect)}
    start = f"{effect}_"
    return {n.removeprefix(effect): i for n, i in named.items() if n.startswith(start)}
