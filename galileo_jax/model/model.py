"""The model: a scene and the effects in it, as one function of its parameters."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

from galileo_jax.model.effects.effect import Effect
from galileo_jax.model.effects.laws import LAWS
from galileo_jax.model.effects.nuisances import NUISANCES
from galileo_jax.model.parameters import LogNormal, Parameter, Uniform
from galileo_jax.model.scene.scene import Scene

SUBSTEPS = 4  # solver steps per recorded step: forces of effects are held constant for these

# A hand-sized object; only mass ratios are visible, so that the prior decides the sum.
MASS_PRIOR = LogNormal(median=0.4, sd=0.7)
WEIGHED_SD = 0.001  # of a declared mass, as a share of it
FRICTION_PRIOR = Uniform(0.0, 1.0)


@dataclass(frozen=True)
class Model:
    """A scene with effects; `theta` vectors follow the order of `parameters`."""

    scene: Scene  # the compiled scene
    duration_s: float  # how long rollouts last
    # Physical effects that are part of the hypothesis (none is the base model)
    effects: tuple[Effect, ...] = ()
    # Always there, after the scenario's own laws
    nuisances: tuple[Effect, ...] = field(default=LAWS + NUISANCES)
    motion: str = "planar"  # "planar", or "free": from the first hit on bodies turn and tip
    # Parameters that stand in place of this scene's own of the same name: one prior for the clips
    # of a series, however far each of them sees
    shared: tuple[Parameter, ...] = ()

    @cached_property
    def parameters(self) -> tuple[Parameter, ...]:
        """Masses, frictions (none in a fall), then the effects' parameters, then the nuisances."""
        found: list[Parameter] = []
        scene = self.scene.surroundings
        weighed = scene.mass_kg or (None,) * len(scene.names)
        for i, mass in enumerate(weighed):
            prior = MASS_PRIOR if mass is None else LogNormal(mass, WEIGHED_SD)
            found.append(Parameter(f"m{i + 1}", "kg", prior, prior.median, "main", 0.1))
            if scene.has_surface:
                found.append(Parameter(f"k{i + 1}", "1", FRICTION_PRIOR, 0.0, "main", 0.02))
        for effect in self.effects + self.nuisances:
            found.extend(effect.parameters(scene))
        shared = {parameter.name: parameter for parameter in self.shared}
        return tuple(shared.get(parameter.name, parameter) for parameter in found)

    @cached_property
    def names(self) -> tuple[str, ...]:
        """The parameters' names, in order."""
        return tuple(parameter.name for parameter in self.parameters)

    @property
    def record_dt_s(self) -> float:
        """Time between recorded steps, s."""
        return SUBSTEPS * self.scene.timestep_s

    @property
    def num_records(self) -> int:
        """Recorded steps of a rollout, its start not counted."""
        return max(1, int(self.duration_s / self.record_dt_s) + 2)

    def by_name(self, theta: Any) -> Mapping[str, Any]:
        """`theta` `[..., parameter]` as a mapping from name to `[...]`."""
        return {name: theta[..., i] for i, name in enumerate(self.names)}

    def index(self, name: str) -> int:
        """Where `name` stands in `theta`; ValueError with the known names otherwise."""
        if name not in self.names:
            raise ValueError(f"unknown parameter {name!r}; known: {', '.join(self.names)}")
        return self.names.index(name)
