"""The reference's experiments as the package's models, so that the two can be compared."""

import math
from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from galileo_jax.clip.schema import ClipObject
from galileo_jax.model.effects.effect import Surroundings
from galileo_jax.model.model import Model
from galileo_jax.model.parameters import absent
from galileo_jax.model.scene.scene import Scene, laid_out, on_ramp
from tests.reference_ramp import Experiment

HIT = Experiment(
    mass_kg=(0.5, 0.3),
    friction=(0.1, 0.2),
    angle_rad=math.radians(20),
    size_m=((0.06, 0.06), (0.06, 0.06)),
    release_m=0.5,
    object2_x_m=0.25,
)
# Without friction everything but gravity on the ramp and the hit keeps its speed.
SMOOTH = replace(HIT, friction=(0.0, 0.0))


def make_surroundings(experiment: Experiment) -> Surroundings:
    """The experiment's geometry."""
    angle, up = experiment.angle_rad, experiment.release_m
    (length1, height1), (length2, height2) = experiment.size_m
    starts, halves = [on_ramp(-up, height1 / 2, angle)], [(length1 / 2, height1 / 2)]
    if experiment.object2_x_m is not None:
        starts.append((experiment.object2_x_m, height2 / 2))
        halves.append((length2 / 2, height2 / 2))
    return Surroundings(
        names=("object1", "object2")[: len(starts)],
        angle_rad=angle,
        gravity=experiment.gravity,
        **laid_out(halves, tuple(starts), angle, has_table=True),
    )


def make_model(experiment: Experiment, duration_s: float) -> Model:
    """The experiment's scene with all nuisances; masses and frictions are parameters."""
    surroundings = make_surroundings(experiment)
    declared = tuple(
        ClipObject(name=name, shape="box", size_m=(length, 0.06, height))
        for name, (length, height) in zip(surroundings.names, experiment.size_m, strict=False)
    )
    return Model(Scene(surroundings, declared), duration_s)


def make_theta(model: Model, experiment: Experiment, given: Mapping[str, float] = {}) -> np.ndarray:
    """The experiment's parameters, nuisances absent but for what is given: `[parameter]`."""
    theta = absent(model.parameters)
    values = dict(given)
    for i in range(len(model.scene.names)):
        values |= {f"m{i + 1}": experiment.mass_kg[i], f"k{i + 1}": experiment.friction[i]}
    for name, value in values.items():
        theta[model.index(name)] = value
    return theta
