"""Linear least squares, and the straight line and the circle through points."""

import math
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
from jaxtyping import Float

# Of a circle: steps, by what share of its radius the last one moves it, singular values of points
# on a line, and the share of its radius to which that is told.
MOST_STEPS, STILL, FLAT, ROUND = 30, 1e-6, 1e-9, 0.05


@dataclass(frozen=True)
class LinearFit:
    """What `design @ solution` makes of values, `[row, ...]`."""

    design: Float[np.ndarray, "row term"]  # `[row, term]`
    solution: np.ndarray  # `[term, ...]`
    left: np.ndarray  # `[row, ...]`, values less what is fitted

    @cached_property
    def inverse(self) -> Float[np.ndarray, "term term"]:
        """The covariance of the solution where the errors of the values have unit variance."""
        return np.linalg.inv(self.design.T @ self.design)

    @property
    def sds(self) -> np.ndarray:
        """Of the solution `[term, ...]`, by the size of what is left; inf of what is not told."""
        rows, terms = self.design.shape
        variance = np.sum(self.left**2, axis=0) / (rows - terms)
        own = np.diagonal(self.inverse)  # by rounding below 0 where nothing tells a term
        return np.sqrt(np.multiply.outer(np.where(own > 0, own, np.inf), variance))


def least_squares(design: Float[np.ndarray, "row term"], values: np.ndarray) -> LinearFit:
    """The solution that leaves the least sum of squares of values, `[row, ...]`."""
    solution = np.linalg.lstsq(design, values, rcond=None)[0]
    return LinearFit(design, solution, values - design @ solution)


def polynomial(since_s: Float[np.ndarray, " row"], values: np.ndarray, degree: int) -> LinearFit:
    """A polynomial of time through values, `[row, ...]`, highest power first."""
    return least_squares(np.vander(since_s, degree + 1), values)


def restricted_likelihood(
    cover: Float[np.ndarray, "*model row row"],
    design: Float[np.ndarray, "row term"],
    values: Float[np.ndarray, " row"],
) -> tuple[Float[np.ndarray, "*model"], Float[np.ndarray, "*model"]]:
    """Of values ~ N(design b, cover), b averaged over: the log-determinant and sum of squares.

        log density = -(log-determinant + sum of squares) / 2 + constant

    Source: Patterson and Thompson (1971), Recovery of inter-block information when block sizes
    are unequal, Biometrika 58, 545.
    """
    root = np.linalg.cholesky(cover)
    white = np.linalg.solve(root, np.column_stack([design, values]))
    basis, upper = np.linalg.qr(white[..., :-1])
    along = np.einsum("...nk,...n->...k", basis, white[..., -1])
    square = np.sum(white[..., -1] ** 2, axis=-1) - np.sum(along**2, axis=-1)
    scale, spread = (np.abs(np.einsum("...nn->...n", each)) for each in (root, upper))
    return 2 * (np.log(scale).sum(axis=-1) + np.log(spread).sum(axis=-1)), square


class Line(NamedTuple):
    """The straight line of least summed squared distances from points of a plane."""

    middle: Float[np.ndarray, "2"]  # of the points
    # Unit vectors; `along` points to what is farthest from the first point
    along: Float[np.ndarray, "2"]
    across: Float[np.ndarray, "2"]
    spread: tuple[float, float]  # summed squares across and along


def line_through(points: Float[np.ndarray, "2 point"]) -> Line:
    """The principal axis of points, in their order."""
    middle = points.mean(axis=1)
    away, gone = points - middle[:, None], points - points[:, :1]
    values, axes = np.linalg.eigh(away @ away.T)
    farthest = gone[:, int(np.argmax((gone**2).sum(axis=0)))]
    along = axes[:, 1] if axes[:, 1] @ farthest >= 0 else -axes[:, 1]
    return Line(middle, along, axes[:, 0], (max(float(values[0]), 0.0), float(values[1])))


def two_lines(points: Float[np.ndarray, "2 point"], fewest: int) -> tuple[Line, Line, int] | None:
    """The two lines through the first points and the others, and how many are on the first.

    Of least summed squares across; None where there are not `fewest` points for either.
    """
    splits = (
        (line_through(points[:, :at]), line_through(points[:, at:]), at)
        for at in range(fewest, points.shape[1] - fewest + 1)
    )
    return min(splits, key=lambda one: one[0].spread[0] + one[1].spread[0], default=None)


class Circle(NamedTuple):
    """A circle."""

    centre: tuple[float, float]
    radius: float  # inf where the points are on a straight line
    radius_sd: float

    @property
    def is_told(self) -> bool:
        """Whether the arc is so round, and so long, that it tells the circle."""
        return self.radius_sd < ROUND * self.radius


def circle(x: np.ndarray, y: np.ndarray) -> Circle:
    """The circle through points `[frame]` of least squared distances from it.

    By Gauss-Newton steps from that of linear least squares, which noise makes smaller.

    Source: Kasa (1976), A circle fitting procedure and its error analysis; Gander, Golub and
    Strebel (1994), Least-squares fitting of circles and ellipses, BIT 34, 558.
    """
    middle = np.array([x.mean(), y.mean()])
    points = np.stack([x, y]) - middle[:, None]
    design = np.column_stack([2 * points.T, np.ones_like(x)])
    a, b, c = least_squares(design, np.sum(points**2, axis=0)).solution
    found = np.array([a, b, math.sqrt(max(c + a**2 + b**2, 0.0))])
    line = Circle((math.inf, math.inf), math.inf, math.inf)
    for _ in range(MOST_STEPS):
        away = points - found[:2, None]
        distance = np.hypot(*away)
        if not distance.min() > 0:
            return line
        design = np.column_stack([-(away / distance).T, -np.ones_like(x)])
        fit = least_squares(design, found[2] - distance)
        found = found + fit.solution
        if np.abs(fit.solution).max() < STILL * abs(found[2]):
            break
    if np.linalg.matrix_rank(design, tol=FLAT * math.sqrt(len(x))) < len(found):
        return line
    centre = float(middle[0] + found[0]), float(middle[1] + found[1])
    sd = float(fit.sds[2]) if len(x) > len(found) else math.inf
    return Circle(centre, abs(float(found[2])), sd)
