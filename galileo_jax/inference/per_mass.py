"""Force constants divided by mass.

If no object was weighed, the motion determines only this ratio: in F = m a, a drag, spring or push
enters as F / m, so the constant itself (kg/m, kg/s, N/m, N) is as uncertain as the mass.
"""

from collections.abc import Mapping

import numpy as np

from galileo_jax.inference.joint_problem import JointProblem
from galileo_jax.model.model import MASS_PRIOR

# Of the prior's spread of a mass nobody weighed: below it the mass is known.
KNOWN_SHARE = 0.5
SUFFIX = "_per_mass"
_UNITS = {
    "kg": "1",
    "kg/m": "1/m",
    "kg/s": "1/s",
    "N": "m/s^2",
    "N/m": "1/s^2",
    "N s": "m/s",
    "N s/m": "1/s",
}


def per_mass_unit(unit: str) -> str | None:
    """The unit of a force constant over a mass; None where `unit` is not that of one."""
    if unit in _UNITS:
        return _UNITS[unit]
    if unit.startswith("kg "):
        return unit.removeprefix("kg ")
    return f"{unit}/kg" if unit.partition("/")[0].split(" ")[0] in ("kg", "N", "J", "W") else None


def force_constants(trials: JointProblem) -> dict[str, str]:
    """Names of the parameters that are constants of forces, and their units per mass."""
    found = {}
    for parameter in trials.model_parameters:
        is_mass = parameter.name.startswith("m") and parameter.name[1:].isdecimal()
        unit = per_mass_unit(parameter.unit)
        if unit is not None and not is_mass and parameter.role != "nuisance":
            found[parameter.name] = unit
    return found


def is_any_weighed(trials: JointProblem) -> bool:
    """Whether a mass was declared, so that masses and forces can be determined at all."""
    return any(
        mass is not None
        for problem in trials.problems
        for mass in problem.model.scene.surroundings.mass_kg
    )


def is_mass_known(trials: JointProblem, draws: np.ndarray) -> bool:
    """Whether draws `[draw, parameter]` tell the first object's mass: weighed, or against one."""
    mass = draws[:, trials.names.index("m1")]
    return is_any_weighed(trials) and bool(np.log(mass).std() < KNOWN_SHARE * MASS_PRIOR.sd)


def per_mass(trials: JointProblem, draws: np.ndarray) -> Mapping[str, tuple[np.ndarray, str]]:
    """By name, the force constants over the mass of object 1, and their units.

    `draws`: `[draw, parameter]`, in the parameters' units.
    """
    names = trials.names
    if "m1" not in names:
        return {}
    mass = draws[:, names.index("m1")]
    return {
        f"{name}{SUFFIX}": (draws[:, names.index(name)] / mass, unit)
        for name, unit in force_constants(trials).items()
    }
