"""Direct alignment of an object's patch with its template: no drift, hundredths of a pixel.

Minimises over pose, gain and offset

    sum_x  w(x) [I(W(x; pose)) - gain T(x) - offset]^2

by inverse-compositional Gauss-Newton with Huber weights; in the end T is stretched a little, too,
as a camera that is not square to the scene stretches what goes along. Because the template stays
the same for the whole clip, errors do not add up from frame to frame; gain and offset take up
flicker.

Source: S. Baker, I. Matthews, "Lucas-Kanade 20 Years On: A Unifying Framework",
Int. J. Computer Vision 56 (2004), doi:10.1023/B:VISI.0000011205.11775.fd.
"""

import math
from dataclasses import dataclass

import cv2
import numpy as np

from galileo_jax.tracking.picture import Picture
from galileo_jax.tracking.pose import compose, rotation

HUBER, REJECT = 2.0, 5.0
"""Residuals beyond this many noise sigmas weigh less (Huber), or nothing (a hand)."""
FINE_PX, COARSE_PX = 0.8, 3.0
"""Widths of the Gaussian smoothing of image and template. Fine: keeps the interpolation
error small; coarse: reaches 5 px and 10 degrees."""
TURNLESS = 0.02
"""An object whose gradients tell the angle less than this share of what they could looks the same
however it is turned: its angle is not followed."""
NUM_RIGID = 5  # rows of the Jacobian without those of a stretched patch
STRETCH_SD, ALIKE_GREY = 0.02, 10.0
"""How much a patch may be stretched (sd), against noise, grey levels, of a pixel whose neighbours
have the same."""
COVERED = 4.0  # noise sigmas: a pixel that differs by more shows something else than the object
FLAT = 0.06
"""Least noise of a plain object, by its contrast: most of its pixels look the same, and tell
nothing of what its edge scatters by, where sampling and what is behind it add to noise."""
NEIGHBOURS = (0.1, 0.9)  # bounds of what neighbouring pixels' noise is believed to correlate by
SETTLED_PX, SETTLED_RAD = 0.01, 3e-4
"""0.005 px at the rim of a 30 px object; smaller steps change nothing."""


@dataclass(frozen=True)
class Fit:
    """A pose and how well the template fits there."""

    pose: np.ndarray  # `(x, y, angle)`
    correlation: float  # weighted correlation of patch and template, 1 is perfect
    noise: float  # robust standard deviation of the residual, grey levels of the smoothed patch
    covered: float  # share of the region that differs by more than `COVERED` noise sigmas
    gain: float  # the patch's contrast against the template's
    weight: np.ndarray  # `[pixel]`, what each pixel of the region counted
    residual: np.ndarray  # `[pixel]`, patch minus fitted template


class Target:
    """A smoothed template with its gradients: what pictures are aligned with."""

    def __init__(
        self,
        image: np.ndarray,
        region: np.ndarray,
        width_px: float,
        shows_turns: bool | None = None,
        is_plain: bool = False,
    ):
        """`image` and `region` (bool) are `[size, size]`; `width_px` the smoothing.

        `shows_turns`: of the object, where that is known; a smear hides turns only in part.
        `is_plain`: whether it is known by its edge alone.
        """
        self.width_px = width_px
        self.radius = (image.shape[0] - 1) // 2
        self.region = region
        inside = np.flatnonzero(region)
        y, x = np.divmod(inside, region.shape[1])
        self.places = np.stack([x - self.radius, y - self.radius]).astype(np.float32)
        self.reach_px = float(np.sqrt((self.places**2).sum(axis=0).max(initial=0)))
        smooth = self.image = cv2.GaussianBlur(image, (0, 0), width_px)
        dx = cv2.Sobel(smooth, cv2.CV_32F, 1, 0, ksize=3, scale=1 / 8).take(inside)
        dy = cv2.Sobel(smooth, cv2.CV_32F, 0, 1, ksize=3, scale=1 / 8).take(inside)
        turned = dy * self.places[0] - dx * self.places[1]
        self.values = smooth.take(inside).astype(np.float64)
        self.least_noise = FLAT * float(self.values.std()) if is_plain else 1e-6
        stretched = [dx * self.places[0], dy * self.places[1]]
        stretched += [dx * self.places[1] + dy * self.places[0]]
        # Rows: the pose in the object's axes, gain, offset, how it is stretched.
        rows = [dx, dy, turned, self.values, np.ones_like(self.values), *stretched]
        self.jacobian = np.stack(rows)
        self.normal = self.jacobian @ self.jacobian.T

        self.shows_turns = self._shows_turns() if shows_turns is None else shows_turns
        # Holds the angle fast where it cannot be told, and the shape nearly so; otherwise only
        # against 0 / 0.
        turn, stretch = 1e-9 if self.shows_turns else 1e12, (ALIKE_GREY / STRETCH_SD) ** 2
        self.ridge = np.diag([1e-9, 1e-9, turn, 1e-9, 1e-9, *3 * [stretch]])

    def num_rows(self, stretches: bool) -> int:
        """How many rows of the Jacobian are fitted: a shape that shows no turns stays rigid."""
        return len(self.jacobian) if stretches and self.shows_turns else NUM_RIGID

    def _shows_turns(self) -> bool:
        normal = self.normal[:NUM_RIGID, :NUM_RIGID] + 1e-9 * np.eye(NUM_RIGID)
        information = 1 / np.linalg.inv(normal)[2, 2]
        possible = self.radius**2 * (normal[0, 0] + normal[1, 1]) / 2
        return bool(information > TURNLESS * possible)

    def values_at(self, picture: Picture, pose: np.ndarray) -> np.ndarray:
        """The smoothed pixels of `picture` in the region at `pose`."""
        return picture.at(pose, self.places, self.reach_px, self.width_px).astype(np.float64)


def align(
    picture: Picture,
    target: Target,
    start: np.ndarray,
    *,
    steps: int = 12,
    robust: bool = True,
    stretches: bool = False,
) -> Fit:
    """Aligns `target` with the `picture` from the pose `start`; see the module.

    With `stretches` the patch may be stretched and sheared a little, as a camera that is not
    quite square to the scene does along the way: a rigid patch whose texture is not the same on
    all sides of its centre would be shifted by it.
    """
    rows = target.num_rows(stretches)
    ridge = target.ridge[:rows, :rows]
    pose = np.array(start, dtype=float)
    jacobian, values = target.jacobian[:rows], target.values
    weight, weighted, normal = np.ones_like(values), jacobian, target.normal[:rows, :rows]
    limit_px = 2 * target.width_px
    for step in range(steps):
        seen = target.values_at(picture, pose)
        solution = np.linalg.solve(normal + ridge, weighted @ seen)
        residual = seen - solution @ jacobian
        size = np.abs(residual)
        # The median of an even number but for one place, in a fraction of np.median's time.
        noise = 1.4826 * _middle(size) + target.least_noise
        if robust:
            weight = (HUBER * noise / np.maximum(size, 1e-9)).clip(max=1.0)
            weight *= size < REJECT * noise
        # seen(x) = gain T(x + move) + offset: the pose has to follow by `move`, and the
        # gradient columns carry the gain.
        gain = solution[3] if abs(solution[3]) > 0.1 else np.copysign(0.1, solution[3] or 1.0)
        move = -solution[:3] / gain
        length = math.hypot(move[0], move[1])
        if length > limit_px:
            move[:2] *= limit_px / length
        move[2] = min(max(move[2], -0.15), 0.15)
        pose = compose(pose, move)
        if step == steps - 1 or (length < SETTLED_PX and abs(move[2]) < SETTLED_RAD):
            break
        if robust:
            weighted = jacobian * weight
            normal = weighted @ jacobian.T
    total = weight.sum() + 1e-300
    a = seen - (weight @ seen) / total
    b = values - (weight @ values) / total
    wb = weight * b
    scale = math.sqrt((weight * a) @ a * (wb @ b)) + 1e-9
    return Fit(
        pose=pose,
        correlation=float(wb @ a / scale),
        noise=float(noise),
        covered=float(np.mean(size > COVERED * noise)),
        gain=float(solution[3]),
        weight=weight,
        residual=residual,
    )


def _middle(size: np.ndarray) -> float:
    return float(np.partition(size.astype(np.float32), len(size) // 2)[len(size) // 2])


def covariance_of(fit: Fit, target: Target, stretches: bool = False) -> np.ndarray:
    """The `[3, 3]` covariance of a fit's pose, in image axes, that the image noise makes.

    The sandwich A^-1 B A^-1 of least squares with correlated noise: smoothing with a Gaussian of
    width s gives white noise the autocorrelation exp(-r^2 / 4 s^2), a Gaussian of width
    sqrt(2) s and sum 4 pi s^2. What remains of a picture is not white (a coder's noise is
    wider, what sampling does to a sharp texture is narrower): s is told by the residual.
    """
    width_px = _correlation_width_px(fit, target)
    rows = target.num_rows(stretches)
    jacobian = target.jacobian[:rows]
    weighted = jacobian * fit.weight
    inverse = np.linalg.inv(weighted @ jacobian.T + target.ridge[:rows, :rows])
    scores = np.zeros((*target.region.shape, rows))
    scores[target.region] = weighted.T
    spread = cv2.GaussianBlur(
        scores, (0, 0), np.sqrt(2) * width_px, borderType=cv2.BORDER_CONSTANT
    )[target.region]
    middle = weighted @ spread * (4 * np.pi * width_px**2)
    own = fit.noise**2 * (inverse @ middle @ inverse)[:3, :3] / max(fit.gain**2, 1e-6)
    turn = np.eye(3)
    turn[:2, :2] = rotation(fit.pose[2])
    return turn @ own @ turn.T


def _correlation_width_px(fit: Fit, target: Target) -> float:
    """The width s of the smoothing by which white noise would get the residual's correlation.

    From neighbouring pixels along both axes: they correlate by exp(-1 / 4 s^2).
    """
    residual, count = np.zeros(target.region.shape), target.region.astype(float)
    residual[target.region] = np.sqrt(fit.weight) * fit.residual
    product = sum((a[1:] * a[:-1]).sum() for a in (residual, residual.T))
    pairs = sum((a[1:] * a[:-1]).sum() for a in (count, count.T))
    own = (residual**2).sum() / count.sum() + 1e-12
    correlation = np.clip(product / max(pairs, 1.0) / own, *NEIGHBOURS)
    return float(0.5 / np.sqrt(-np.log(correlation)))
