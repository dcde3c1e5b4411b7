"""An acceleration of any form: a smooth function of time for each object.

    a(t) = s sum_k B_k(t) w_k,    w = L z,    B_k cubic B-splines,    L L' = Matern-3/2 covariance

It is not a candidate: it is shown, or allowed for, when no candidate explains the data. The
covariance between knots makes it smooth; the parameters `z` are independent.

Source: de Boor, A Practical Guide to Splines (2001); Rasmussen and Williams, Gaussian
Processes for Machine Learning (2006), section 4.2.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from galileo_jax.model.effects.effect import Effect, Force, State, Surroundings, Theta
from galileo_jax.model.parameters import Normal, Parameter

NUM_KNOTS, NUM_KNOTS_AFTER = 14, 8  # of object 1 at first, and of all else
SD_M_S2 = 2.0
LENGTH = 2.0  # of the covariance, in knots

Array = Any
Span = tuple[float, float]
Curve = Callable[[Array], Array]


def mixing(num_knots: int) -> np.ndarray:
    """`L`: independent numbers to spline weights, `[knot, knot]`."""
    apart = np.sqrt(3) * np.abs(np.subtract.outer(*[np.arange(num_knots)] * 2)) / LENGTH
    return np.linalg.cholesky((1 + apart) * np.exp(-apart))


def splines(time_s: Array, begin_s: Array, end_s: Array, num_knots: int) -> Array:
    """The B-splines at times `[...]`, kept from beyond `[begin_s, end_s]`: `[..., knot]`.

    They add up to 1.
    """
    share = (time_s - begin_s) / (end_s - begin_s)
    xp = share.__array_namespace__()
    at = 1.0 + xp.clip(share, 0.0, 1.0) * (num_knots - 3)
    u = abs(at[..., None] - xp.asarray(np.arange(num_knots, dtype=float)))
    near = 2 / 3 - u**2 + u**3 / 2
    far = (2 - xp.minimum(u, xp.asarray(2.0))) ** 3 / 6
    return xp.where(u < 1, near, far)


@dataclass(frozen=True, eq=False)
class FreeAcceleration(Effect):
    """The acceleration of every object, in pieces over the time in which it moves.

    Between pieces it may jump: what depends on the speed does, where objects collide. The
    spans reach compiled code as parameters that nobody lets free: one program serves all
    clips, and the effects are equal whatever their spans.
    """

    # `[object][piece]`, when each begins and ends, s since the release, in order
    spans_s: tuple[tuple[Span, ...], ...]

    name = "free_acceleration"

    def identity(self) -> tuple[Any, ...]:
        """The class: its attributes reach hooks as parameters."""
        return (type(self),)

    def parameters(self, scene: Surroundings) -> tuple[Parameter, ...]:
        """The knots, and the spans, which are given."""
        found = []
        for i, spans in enumerate(self.spans_s):
            for piece, span in enumerate(spans):
                for name in _knots(i, piece):
                    found.append(Parameter(name, "1", Normal(0.0, 1.0), 0.0, "latent", 0.1, True))
                for name, value in zip(_span(i, piece), span, strict=True):
                    found.append(
                        Parameter(name, "s", Normal(value, 1.0), value, "given", None, True)
                    )
        return tuple(found)

    def force(self, theta: Theta, scene: Surroundings) -> Force:
        """The mass times the acceleration at the time."""
        mass = scene.mass(theta)
        xp = mass[0].__array_namespace__()
        pieces = [
            [self._piece(theta, i, piece, xp) for piece in range(len(spans))]
            for i, spans in enumerate(self.spans_s)
        ]

        def push(state: State) -> Array:
            forces = []
            for own_mass, (first, *later) in zip(mass, pieces, strict=True):
                total = first[1](state.time_s)
                for begin, value in later:
                    total = xp.where(state.time_s >= begin, value(state.time_s), total)
                forces.append(own_mass * total)
            return xp.stack(forces, axis=-1)

        return push

    def knots(self, index: int) -> tuple[str, ...]:
        """The names of all of an object's knots; objects are counted from 0."""
        return tuple(n for p in range(len(self.spans_s[index])) for n in _knots(index, p))

    def knot_values(self, times_s: np.ndarray, wanted: np.ndarray, index: int) -> np.ndarray:
        """The parameters' `z` `[knot, curve]` with which an object comes closest to given curves.

        `wanted`: accelerations, `[time, curve]`, m/s^2. `index`: of the object.
        """
        blocks = []
        spans = self.spans_s[index]
        ends = [*(begin for begin, _ in spans[1:]), np.inf]
        before = -np.inf
        for piece, ((begin, end), until) in enumerate(zip(spans, ends, strict=True)):
            count = len(_knots(index, piece))
            basis = splines(times_s, np.asarray(begin), np.asarray(end), count) @ mixing(count)
            inside = (times_s >= before) & (times_s < until)
            blocks.append(np.where(inside[:, None], basis * SD_M_S2, 0.0))
            before = until
        return np.linalg.lstsq(np.concatenate(blocks, axis=1), wanted, rcond=1e-10)[0]

    def _piece(self, theta: Theta, index: int, piece: int, xp: Any) -> tuple[Array, Curve]:
        """When a piece begins, and its acceleration as a function of time."""
        begin, end = (theta[name] for name in _span(index, piece))
        own = xp.stack([theta[name] for name in _knots(index, piece)], axis=-1)
        count = own.shape[-1]
        weight = SD_M_S2 * (own @ xp.asarray(mixing(count).T))
        return begin, lambda t: xp.sum(weight * splines(t, begin, end, count), axis=-1)


def _knots(index: int, piece: int) -> tuple[str, ...]:
    count = NUM_KNOTS if index == 0 and piece == 0 else NUM_KNOTS_AFTER
    return tuple(f"free_acceleration_{index + 1}_{piece + 1}_{k}" for k in range(count))


def _span(index: int, piece: int) -> tuple[str, str]:
    name = f"free_acceleration_{index + 1}_{piece + 1}"
    return f"{name}_begin", f"{name}_end"
