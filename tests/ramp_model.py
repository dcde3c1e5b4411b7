"""The reference's experiments as the package's models, so that the two can be compared."""

import math
from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from galileo_jax.clip.schema import ClipObject
from galileo_jax.model.effects.effect import Surroundings
from galileo_jax.model.model import Model
from galileo_jax.model.parameters import absent
from galileo_jax.model.scene.scene import Scene, start_paths
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
    cos, sin = math.cos(angle), math.sin(angle)
    start = (-up * cos + height1 / 2 * sin, up * sin + height1 / 2 * cos)
    starts, halves = [start], [(length1 / 2, height1 / 2)]
    if experiment.object2_x_m is not None:
        starts.append((experiment.object2_x_m, height2 / 2))
        halves.append((length2 / 2, height2 / 2))
    corner = tuple(height * math.tan(angle / 2) for _, height in halves)
    return Surroundings(
        names=("object1", "object2")[: len(starts)],
        angle_rad=angle,
        gravity=experiment.gravity,
        half_length_m=tuple(length for length, _ in halves),
        half_height_m=tuple(height for _, height in halves),
        corner_m=corner,
        start_m=tuple(starts),
        start_path_m=start_paths(tuple(starts), corner, angle),
        has_table=True,
        comes_down=(True, False)[: len(starts)],
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
