"""Board shape: a board that sags, whose slope varies slowly along the way.

    slope(q) = angle + d(q),    d(q) = sum over n of c_n P_n(2 q / L - 1)

q: the way along the board; L: the length of it that is seen; P_n: Legendre polynomials, n from 1,
so that d is 0 on average and the angle is the mean one; from 0 in a valley whose mean slope is
hardly any, where the angle is that at the start. The weight pulls along the true
slope; friction is that of the force on the board, g cos(slope) and what the bend takes of the
speed, -v^2 d'(q); the path in the picture is bent alike:

    along = integral of cos d dq,    across = -integral of sin d dq

Only where the path is clearly bent (`assembly/board_path.py`), which gives the prior.
"""

from typing import Any

from numpy.polynomial import legendre

from galileo_jax.model.effects import Effect, Normal, Parameter, Surroundings
from galileo_jax.model.effects.effect import Theta as Theta
from galileo_jax.numerics.units import NOMINAL_SCALE_PX_PER_M

LENGTH = "board_length"  # in `Surroundings.expected`: of the part that is seen, as measured
MOST = 5  # of n
NODES, WEIGHTS = legendre.leggauss(8)  # exact for polynomials of degree 15


class BoardShape(Effect, where=lambda scene: LENGTH in scene.expected):
    name = "board_slope"

    def parameters(self, scene):
        names = [f"{self.name}_{n}" for n in range(MOST + 1)]
        return tuple(
            Parameter(name, "rad", Normal(*scene.expected[name]), 0.0, "nuisance", 0.1)
            for name in names
            if name in scene.expected
        )

    def force(self, theta, scene):
        weight = scene.weight(theta)
        xp = weight.__array_namespace__()
        angle = xp.asarray(scene.angle_rad)

        def pull(state):
            turned, _ = self._slope(state.path_m, theta, scene)
            return weight * (xp.sin(angle + turned) - xp.sin(angle))

        return pull

    def friction(self, theta, scene):

        def law(state, k):
            xp = k.__array_namespace__()
            angle, gravity = xp.asarray(scene.angle_rad), xp.asarray(scene.gravity)[..., None]
            turned, bend = self._slope(state.path_m, theta, scene)
            across = gravity * xp.cos(angle + turned) - state.speed_m_s**2 * bend
            return k * xp.maximum(across, xp.zeros_like(across)) / (gravity * xp.cos(angle))

        return law

    def measure(self, position_m, theta, scene):
        xp = position_m.__array_namespace__()
        start = xp.asarray(scene.start_m)[:, :, None]
        angle = xp.asarray(scene.angle_rad)
        cos, sin = xp.cos(angle), xp.sin(angle)
        away = position_m - start
        way = away[:, 0] * cos - away[:, 1] * sin
        nodes = 0.5 * (1.0 + xp.asarray(NODES))
        turned, _ = self._slope(way[..., None] * nodes, theta, scene)
        share = 0.5 * way[..., None] * xp.asarray(WEIGHTS)
        short = xp.sum(share * (1.0 - xp.cos(turned)), axis=-1)
        drop = xp.sum(share * xp.sin(turned), axis=-1)
        moved = [-short * cos - drop * sin, short * sin - drop * cos]
        return position_m + xp.stack(moved, axis=1)

    def _slope(self, path_m: Any, theta: Theta, scene: Surroundings) -> tuple[Any, Any]:
        """d(q) and its change per metre at `path_m` `[..., place]`."""
        xp = path_m.__array_namespace__()
        length, _ = scene.expected[LENGTH]
        if not scene.is_scale_known:
            length = length * NOMINAL_SCALE_PX_PER_M / theta["pixels_per_metre"][..., None]
        u = 2.0 * path_m / length - 1.0
        # Beyond what is seen the board goes on straight.
        inside = xp.clip(u, -1.0, 1.0)
        turned, bend = xp.zeros_like(inside), xp.zeros_like(inside)
        # P_n and its derivative by their recurrences, from P_-1 = 0 and P_0 = 1 on.
        before, here = xp.zeros_like(inside), xp.ones_like(inside)
        rise_before, rise = xp.zeros_like(inside), xp.zeros_like(inside)
        for n in range(MOST + 1):
            if (name := f"{self.name}_{n}") in scene.expected:
                value = theta[name][..., None]
                turned, bend = turned + value * here, bend + value * rise
            following = ((2 * n + 1) * inside * here - n * before) / (n + 1)
            rising = rise_before + (2 * n + 1) * here
            before, here, rise_before, rise = here, following, rise, rising
        return turned, xp.where(inside == u, bend, 0.0 * bend) * 2.0 / length
