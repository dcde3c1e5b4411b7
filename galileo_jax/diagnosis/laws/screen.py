"""Which formulas an inferred missing force suggests.

    target = sum over objects  response_i (c f(t, q_i, v_i))  +  unit noise

with everything that friction, masses and nuisances can do made part of the noise, as in `formula`.
The response was computed by rollouts round a fit with a free acceleration, so that the data are
explained, not the smooth curve. Constants are tried on grids; what is asked of a formula is

    gain in chi2 / 2  -  log(n) / 2 for each number  -  log(10) for a second factor.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import log

import numpy as np
from scipy.linalg import solve_triangular

from galileo_jax.diagnosis.laws.grammar import Structure, structures
from galileo_jax.diagnosis.missing_force import View

LENGTH_NATS = log(10.0)  # a second factor makes a formula a tenth as probable
NUM_LAWS, NUM_OF_FAMILY, NUM_STARTS = 8, 2, 3
BEHIND = 40.0  # nats: what is further behind the best formula is not fitted
SHOWS = 1e-6  # of the largest column: what is less does not show


@dataclass(frozen=True)
class Suggestion:
    """A formula that is worth a fit.

    Attributes:
      structure: of the formula.
      starts: constants by name, the best first.
      strengths: c of each start, of the first object; of a friction c times its coefficient.
      score: nats, see above.
    """

    structure: Structure
    starts: tuple[Mapping[str, float], ...]
    strengths: tuple[float, ...]
    score: float


@dataclass(frozen=True)
class Sight:
    """One clip's target and responses, all else made part of the noise.

    Attributes:
      view: the clip's.
      target: `[value]`.
      responses: of each object `[value, time]`.
      masses: of the objects, kg.
    """

    view: View
    target: np.ndarray
    responses: tuple[np.ndarray, ...]
    masses: np.ndarray

    @classmethod
    def of(cls, view: View) -> "Sight":
        """From a view."""
        target = view.target()
        rest = view.fit.jacobian[:, view.others()]
        lower = np.linalg.cholesky(np.eye(len(target)) + rest @ rest.T)
        white = solve_triangular(lower, target, lower=True)
        responses = []
        for i in range(len(view.path_m)):
            shown = np.zeros((len(target), len(view.time_s)))
            if view.moves[i].any():
                shown[:, view.moves[i]] = solve_triangular(lower, view.shows(i), lower=True)[
                    :, view.moves[i]
                ]
            responses.append(shown)
        theta = view.trials.theta(view.fit.z, view.fit.free)
        named = view.model.by_name(view.trials.of_clip(theta, 0))
        masses = [float(named[f"m{i + 1}"]) for i in range(len(view.path_m))]
        return cls(view, white, tuple(responses), np.array(masses))

    def columns(self, structure: Structure, grid: Mapping[str, np.ndarray]) -> np.ndarray:
        """How the formula with a strength of 1 shows, `[object, value, point of the grid]`."""
        view, found = self.view, []
        scene = view.model.scene.surroundings
        constants = {name: values[:, None] for name, values in grid.items()}
        for i, response in enumerate(self.responses):
            if i > 0 and not structure.is_on_all:
                continue
            q, v = view.path_m[i], view.speed_m_s[i]
            size = len(next(iter(grid.values()))) if grid else 1
            f = np.broadcast_to(
                structure.value(view.time_s, q, v, constants), (size, len(view.time_s))
            )
            if structure.nature != "push":
                f = -np.sign(v) * f
            if structure.nature == "friction":
                f = f * scene.gravity * np.where(q < 0, np.cos(scene.angle_rad), 1.0)
            if structure.nature == "drag_force":
                f = f * self.masses[0] / self.masses[i]
            found.append(response @ f.T)
        return np.stack(found)


def suggestions(views: Sequence[View]) -> list[Suggestion]:
    """The formulas that promise most, best first."""
    sights = [Sight.of(view) for view in views]
    scene = views[0].model.scene.surroundings
    ranges = _ranges(views)
    found = [
        one
        for structure in structures(scene.has_surface, len(scene.names))
        if (one := _suggestion(sights, structure, ranges)) is not None
    ]
    found.sort(key=lambda one: -one.score)
    chosen: list[Suggestion] = []
    for one in found:
        alike = [c for c in chosen if c.structure.family == one.structure.family]
        if len(alike) < NUM_OF_FAMILY and one.score > max(found[0].score - BEHIND, 0.0):
            chosen.append(one)
    return chosen[:NUM_LAWS]


def _ranges(views: Sequence[View]) -> dict[str, tuple[float, float]]:
    """What of time and place is seen in motion."""
    times = np.concatenate([view.time_s[view.moves.any(axis=0)] for view in views])
    places = np.concatenate([view.path_m[view.moves] for view in views])
    if not places.size:
        return {"t": (0.0, 1.0), "q": (0.0, 1.0)}
    reach = float(np.ptp(places))
    return {
        "t": (float(times.min()), float(times.max())),
        # What acts from afar may stand beyond the way.
        "q": (float(places.min()) - 0.3 * reach, float(places.max()) + 0.3 * reach),
    }


def constant_range(structure: Structure, views: Sequence[View], name: str) -> tuple[float, float]:
    """Over which a constant without a prior of its own is uniform."""
    factor, _ = structure.constants[name]
    return _ranges(views)[factor.variable]


def _grid(structure: Structure, ranges: Mapping[str, tuple[float, float]]) -> dict[str, np.ndarray]:
    values = []
    for factor, constant in structure.constants.values():
        if isinstance(constant.grid, int):
            values.append(np.linspace(*ranges[factor.variable], constant.grid))
        else:
            values.append(np.asarray(constant.grid))
    points = np.meshgrid(*values, indexing="ij") if values else []
    return {name: point.ravel() for name, point in zip(structure.constants, points, strict=True)}


def _suggestion(
    sights: Sequence[Sight], structure: Structure, ranges: Mapping[str, tuple[float, float]]
) -> Suggestion | None:
    """The best constants of a formula; None where it does not show."""
    grid = _grid(structure, ranges)
    columns = np.concatenate([sight.columns(structure, grid) for sight in sights], axis=1)
    if structure.nature != "friction":
        columns = columns.sum(axis=0, keepdims=True)
    target = np.concatenate([sight.target for sight in sights])
    power = np.einsum("ovg,pvg->gop", columns, columns)
    along = np.einsum("ovg,v->go", columns, target)
    size = np.trace(power, axis1=1, axis2=2)
    if not size.max() > SHOWS:
        return None
    # Strengths of unit size are what the priors expect.
    power = power + 0.1 * np.eye(power.shape[-1])
    strength = np.linalg.solve(power, along[..., None])[..., 0]
    gain = 0.5 * np.einsum("go,go->g", along, strength)
    numbers = columns.shape[0] + len(structure.constants)
    price = 0.5 * numbers * log(np.count_nonzero(target))
    price += LENGTH_NATS * (len(structure.factors) - 1)
    best = np.argsort(-gain)[:NUM_STARTS]
    return Suggestion(
        structure,
        tuple({name: float(values[i]) for name, values in grid.items()} for i in best),
        tuple(float(strength[i, 0]) for i in best),
        float(gain[best[0]]) - price,
    )
