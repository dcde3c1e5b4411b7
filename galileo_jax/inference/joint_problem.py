"""The joint inverse problem: trials of the same objects, and all their parameters.

The unknowns are `z`, in which every prior is standard normal: first the parameters (those of
the objects once, those of a trial once per clip), then the logarithm of every clip's noise
scale in units of its prior's width.

    log p(z | data) = sum over clips  log N(observed; predicted(z), C(noise))  -  z.z / 2

A hypothesis says which of the models' effects are there: the parameters of all others are
held at `absent`, in their units, and have no z.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from jaxtyping import Float, Int
from scipy.special import chdtrc

from galileo_jax.inference.problem import Problem
from galileo_jax.model.parameters import LogNormal, Parameter, PriorTable
from galileo_jax.statespace.term import Term

NOISE_SD = 0.3  # the tracker knows its noise within some thirty per cent
NOISE_SCALE = Parameter("noise_scale", "1", LogNormal(1.0, NOISE_SD), 1.0, "nuisance", step=None)
# Fitted noise over what the tracker states: so far a tracker may be wrong about it. Beyond, the
# statement is wrong or what is left is no noise.
NOISE_SCALE_RANGE = (0.5, 1.5)
NUM_PRIOR_DRAWS = 2000
CHANCE = 0.01  # noise leaves as much or more so seldom: then it is something else


def noise_explains(chi2: float, degrees: float, noise_scale: float = 1.0) -> bool:
    """Whether noise of that scale leaves a sum of squares as large once in 1 / `CHANCE` times.

    `chi2`: in units of the stated noise. `degrees`: of freedom; at least one is taken.
    `noise_scale`: in these units.
    """
    return bool(chdtrc(max(degrees, 1.0), chi2 / noise_scale**2) > CHANCE)


@dataclass(frozen=True)
class JointProblem:
    """Clips of the same objects.

    Raises:
      ValueError: by the first use of its parameters; what clips share has several priors.
    """

    # one per clip, all with the same effects and, as `with_shared_parameters` leaves them, the same
    # priors of what they share
    problems: tuple[Problem, ...]

    @cached_property
    def _layout(self) -> tuple[tuple[Parameter, ...], tuple[np.ndarray, ...]]:
        parameters: list[Parameter] = []
        where: dict[str, int] = {}
        columns = []
        for clip, problem in enumerate(self.problems):
            column = []
            for parameter in problem.parameters:
                name = parameter.name
                if parameter.role == "nuisance" or parameter.per_clip:
                    name = self._own_name(name, clip)
                if name not in where:
                    where[name] = len(parameters)
                    parameters.append(replace(parameter, name=name))
                elif parameters[where[name]].prior != parameter.prior:
                    raise ValueError(
                        f"{problem.name}: {name} has another prior than in an earlier clip, "
                        "so that one z would be two values; see problem.with_shared_parameters"
                    )
                column.append(where[name])
            columns.append(np.array(column))
        return tuple(parameters), tuple(columns)

    def _own_name(self, name: str, clip: int) -> str:
        return name if len(self.problems) == 1 else f"{name}_{clip + 1}"

    @property
    def model_parameters(self) -> tuple[Parameter, ...]:
        """All clips' parameters, noise scales not among them."""
        return self._layout[0]

    @property
    def columns(self) -> tuple[np.ndarray, ...]:
        """For each clip, where its model's parameters stand in `model_parameters`."""
        return self._layout[1]

    @cached_property
    def parameters(self) -> tuple[Parameter, ...]:
        """The models' parameters and the noise scales."""
        noise = [
            replace(NOISE_SCALE, name=self._own_name(NOISE_SCALE.name, clip))
            for clip in range(len(self.problems))
        ]
        return (*self.model_parameters, *noise)

    @cached_property
    def names(self) -> tuple[str, ...]:
        """The parameters' names, in order."""
        return tuple(parameter.name for parameter in self.parameters)

    @cached_property
    def num_values(self) -> int:
        """How many numbers were measured."""
        return int(sum(problem.data.num_values for problem in self.problems))

    @cached_property
    def coarse_steps(self) -> np.ndarray:
        """Steps in `z` before the posterior's scale is known, `[model parameter]`."""
        return np.array([p.step or 1.0 for p in self.model_parameters])

    @cached_property
    def priors(self) -> PriorTable:
        """Of `parameters`."""
        return PriorTable.of(self.parameters)

    @cached_property
    def absent(self) -> np.ndarray:
        """The values at which nothing but the scene is there, `[parameter]`."""
        return np.array([p.absent for p in self.parameters])

    def free(self, effects: Sequence[str]) -> np.ndarray:
        """Which parameters a hypothesis with these effects leaves free, `[parameter]`.

        Raises:
          ValueError: the models have no effect of that name.
        """
        brought = self._brought
        if unknown := [name for name in effects if name not in brought]:
            raise ValueError(f"effects not in the model: {unknown}; there: {sorted(brought)}")
        found = np.array([p.role != "given" for p in self.parameters])
        for name in brought.keys() - set(effects):
            found &= ~brought[name]
        return found

    def brought_by(self, effect: str) -> np.ndarray:
        """Where the parameters of one of the models' effects stand, its strengths first: indices.

        Raises:
          ValueError: the models have no effect of that name.
        """
        if effect not in self._brought:
            raise ValueError(f"effects not in the model: {effect}; there: {sorted(self._brought)}")
        return np.flatnonzero(self._brought[effect])

    @cached_property
    def _brought(self) -> dict[str, np.ndarray]:
        """By the effect's name, which parameters it brings, `[parameter]`."""
        found: dict[str, np.ndarray] = {}
        for problem, column in zip(self.problems, self.columns, strict=True):
            scene, names = problem.model.scene.surroundings, problem.model.names
            for effect in problem.model.effects:
                own = found.setdefault(effect.name, np.zeros(len(self.parameters), bool))
                own[[column[names.index(p.name)] for p in effect.parameters(scene)]] = True
        return found

    @cached_property
    def terms(self) -> tuple[Term, ...]:
        """Imperfections that have a place in any of the clips, by name."""
        found = {term.name: term for problem in self.problems for term in problem.terms}
        return tuple(found[name] for name in sorted(found))

    @property
    def sizes(self) -> Mapping[str, float] | None:
        """Of imperfections, as `Problem.sizes`: of all clips the same."""
        return self.problems[0].sizes

    def with_sizes(self, sizes: Mapping[str, float] | None) -> "JointProblem":
        """The same with other sizes of imperfections."""
        return JointProblem(tuple(problem.with_sizes(sizes) for problem in self.problems))

    @property
    def all_effects(self) -> tuple[str, ...]:
        """Names of the models' effects."""
        return tuple(effect.name for effect in self.problems[0].model.effects)

    def without_place(self) -> list[str]:
        """Effects of the models that bring no parameters into any of the clips."""
        scenes = [problem.model.scene.surroundings for problem in self.problems]
        effects = self.problems[0].model.effects
        return [e.name for e in effects if not any(e.parameters(scene) for scene in scenes)]

    def theta(self, z: np.ndarray, free: np.ndarray | None = None) -> np.ndarray:
        """Parameters in their units, `[..., parameter]`, noise scales last."""
        theta = self.priors.in_units(z)
        return theta if free is None else np.where(free, theta, self.absent)

    @cached_property
    def prior_draws(self) -> np.ndarray:
        """Draws from the priors in the parameters' units, `[draw, parameter]`: always the same."""
        generator = np.random.default_rng(0)
        return self.theta(generator.standard_normal((NUM_PRIOR_DRAWS, len(self.parameters))))

    def of_clip(self, theta: np.ndarray, clip: int) -> np.ndarray:
        """The parameters of one clip's model, `[..., model parameter]`."""
        return np.asarray(theta)[..., self.columns[clip]]

    def simulate(self, theta: Float[np.ndarray, " parameter"]) -> list[np.ndarray]:
        """What the camera would see of each clip: `[object, axis, frame]`, m."""
        each = enumerate(self.problems)
        return [problem.simulate(self.of_clip(theta, clip)) for clip, problem in each]

    def places(self, names: Sequence[str]) -> Int[np.ndarray, " name"]:
        """Where parameters of these names stand; -1 where there is none of that name."""
        where = {name: i for i, name in enumerate(self.names)}
        return np.array([where.get(name, -1) for name in names])

    def alone(self, clip: int) -> "JointProblem":
        """One of the clips."""
        return JointProblem((self.problems[clip],))

    def columns_of(self, clip: int) -> np.ndarray:
        """Where the parameters of `alone(clip)`, noise scale last, stand in `parameters`."""
        return np.append(self.columns[clip], len(self.model_parameters) + clip)

    def noise_scale(self, theta: np.ndarray, clip: int) -> float:
        """The noise scale of one clip."""
        return float(theta[len(self.model_parameters) + clip])

    def whitened(
        self, theta: Float[np.ndarray, "point parameter"], noise_scale: Float[np.ndarray, " clip"]
    ) -> list[Float[np.ndarray, "point value"]]:
        """Whitened residuals of each clip, from rollouts."""
        found = []
        for clip, problem in enumerate(self.problems):
            predicted = problem.simulate_batch(self.of_clip(theta, clip))
            found.append(problem.whiten(predicted, float(noise_scale[clip])))
        return found
