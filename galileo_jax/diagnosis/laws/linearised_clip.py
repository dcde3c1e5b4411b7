"""How a formula shows in one clip, with everything that friction and masses can do made noise."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from scipy.linalg import solve_triangular

from galileo_jax.diagnosis.laws.grammar import Structure
from galileo_jax.diagnosis.missing_force import View

LEAST_FRICTION = -0.05  # that a coefficient may come to, beyond minus itself: it may be wrong


@dataclass(frozen=True)
class LinearisedClip:
    """One clip's target and responses, all else made part of the noise."""

    view: View  # the clip's
    target: np.ndarray  # `[value]`
    responses: tuple[np.ndarray, ...]  # of each object `[value, time]`
    masses: np.ndarray  # of the objects, kg, as fitted; 0 of those without
    frictions: np.ndarray  # their coefficients, likewise

    @classmethod
    def of(cls, view: View) -> "LinearisedClip":
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
        named = view.model.by_name(
            view.trials.of_clip(view.trials.theta(view.fit.z, view.fit.free), 0)
        )
        masses, frictions = (
            np.array([float(named.get(f"{kind}{i + 1}", 0.0)) for i in range(len(view.path_m))])
            for kind in "mk"
        )
        return cls(view, white, tuple(responses), masses, frictions)

    def is_possible(
        self, structure: Structure, grid: Mapping[str, np.ndarray], strength: np.ndarray
    ) -> np.ndarray:
        """Whether no friction would have to be negative, `[point of the grid]`.

        `strength` is `[point of the grid, object]`, c times the coefficients.
        """
        found = np.ones(len(strength), bool)
        for i in range(strength.shape[1]):
            if self.view.moves[i].any():
                f = self._values(structure, grid, i)[:, self.view.moves[i]]
                change = (strength[:, i : i + 1] * f).min(axis=1)
                found &= change >= LEAST_FRICTION - 2 * self.frictions[i]
        return found

    def columns(self, structure: Structure, grid: Mapping[str, np.ndarray]) -> np.ndarray:
        """How the formula with a strength of 1 shows, `[object, value, point of the grid]`."""
        found = self.accelerations(structure, grid)
        acting = self.responses if structure.is_on_all else self.responses[:1]
        return np.stack([response @ own.T for response, own in zip(acting, found, strict=False)])

    def accelerations(self, structure: Structure, grid: Mapping[str, np.ndarray]) -> np.ndarray:
        """By a formula with a strength of 1, m/s^2, `[object, point of the grid, time]`.

        Along the fitted motion; those of a friction, by a change of its coefficient.
        """
        view, found = self.view, []
        scene = view.model.scene.surroundings
        for i, (q, v) in enumerate(zip(view.path_m, view.speed_m_s, strict=True)):
            f = self._values(structure, grid, i)
            if structure.nature != "push":
                f = -np.sign(v) * f
            if structure.nature == "friction":
                f = f * scene.gravity * np.where(q < 0, np.cos(scene.angle_rad), 1.0)
            if structure.nature == "drag_force" and i > 0:
                f = f * self.masses[0] / self.masses[i]
            found.append(f if i == 0 or structure.is_on_all else np.zeros_like(f))
        return np.stack(found)

    def _values(self, structure: Structure, grid: Mapping[str, np.ndarray], i: int) -> np.ndarray:
        """On the way of object i, `[point of the grid, time]`; of a friction its change."""
        view, size = self.view, len(next(iter(grid.values()))) if grid else 1
        constants = {name: own[:, None] for name, own in grid.items()}
        f = structure.value(view.time_s, view.path_m[i], view.speed_m_s[i], constants)
        if structure.nature == "friction":
            f = f - structure.value(0.0, view.start_path_m[i], 0.0, constants)
        return np.broadcast_to(f, (size, len(view.time_s)))
