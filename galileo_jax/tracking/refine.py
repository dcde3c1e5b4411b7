"""Direct alignment of an object's patch with its template: no drift, hundredths of a pixel.

Minimises over pose, gain and offset

    sum_x  w(x) [I(W(x; pose)) - gain T(x) - offset]^2

by inverse-compositional Gauss-Newton with Huber weights. Because the template stays the same
for the whole clip, errors do not add up from frame to frame; gain and offset take up flicker.

Source: S. Baker, I. Matthews, "Lucas-Kanade 20 Years On: A Unifying Framework",
Int. J. Computer Vision 56 (2004), doi:10.1023/B:VISI.0000011205.11775.fd.
"""

from dataclasses import dataclass

import cv2
import numpy as np

from galileo_jax.tracking.pose import compose, on_sampling_grid, patch_at, rotation

HUBER, REJECT = 2.0, 5.0
"""Residuals beyond this many noise sigmas weigh less (Huber), or nothing (a hand)."""
FINE_PX, COARSE_PX = 0.8, 3.0
"""Widths of the Gaussian smoothing of image and template. Fine: keeps the interpolation
error small; coarse: reaches 5 px and 10 degrees."""


TURNLESS = 0.02
"""A disc without texture looks the same however it is turned. An object whose gradients tell the
angle less than this share of what they could is taken as one: its angle is not followed."""
COVERED = 4.0
"""A pixel that differs by more noise sigmas shows something else than the object."""
NEIGHBOURS = (0.1, 0.9)
"""Bounds of what neighbouring pixels' noise is believed to correlate by."""
SETTLED_RAD = 3e-4
"""A turn that moves the rim of a 30 px object by 0.005 px; smaller steps change nothing."""


@dataclass(frozen=True)
class Fit:
    """A pose and how well the template fits there.

    Attributes:
      pose: `(x, y, angle)`.
      correlation: weighted correlation of patch and template, 1 is perfect.
      noise: robust standard deviation of the residual, grey levels of the smoothed patch.
      covered: share of the region that differs by more than `COVERED` noise sigmas.
      gain: the patch's contrast against the template's.
      weight: `[pixel]`, what each pixel of the region counted.
      residual: `[pixel]`, patch minus fitted template.
    """

    pose: np.ndarray
    correlation: float
    noise: float
    covered: float
    gain: float
    weight: np.ndarray
    residual: np.ndarray


class Target:
    """A smoothed template with its gradients: what patches are aligned with."""

    def __init__(self, image: np.ndarray, region: np.ndarray, width_px: float):
        """`image` and `region` (bool) are `[size, size]`; `width_px` the smoothing."""
        self.width_px = width_px
        self.radius = (image.shape[0] - 1) // 2
        self.region = region
        smooth = cv2.GaussianBlur(image, (0, 0), width_px)
        dx = cv2.Sobel(smooth, cv2.CV_32F, 1, 0, ksize=3, scale=1 / 8)[region]
        dy = cv2.Sobel(smooth, cv2.CV_32F, 0, 1, ksize=3, scale=1 / 8)[region]
        y, x = np.nonzero(region)
        turned = dy * (x - self.radius) - dx * (y - self.radius)
        self.values = smooth[region].astype(np.float64)
        # Columns: the pose in the object's axes, gain, offset.
        self.jacobian = np.column_stack(
            [dx, dy, turned, self.values, np.ones_like(self.values)]
        ).astype(np.float64)

        self.shows_turns = self._shows_turns()
        # Holds the angle fast where it cannot be told; otherwise only against 0 / 0.
        self.ridge = np.diag([1e-9, 1e-9, 1e-9 if self.shows_turns else 1e12, 1e-9, 1e-9])

    def _shows_turns(self) -> bool:
        normal = self.jacobian.T @ self.jacobian + 1e-9 * np.eye(5)
        information = 1 / np.linalg.inv(normal)[2, 2]
        possible = self.radius**2 * (normal[0, 0] + normal[1, 1]) / 2
        return bool(information > TURNLESS * possible)

    def values_at(self, image: np.ndarray, pose: np.ndarray) -> np.ndarray:
        """The smoothed pixels of `image` in the region at `pose`."""
        patch = patch_at(image, pose, self.radius)
        return cv2.GaussianBlur(patch, (0, 0), self.width_px)[self.region].astype(np.float64)


def align(
    image: np.ndarray, target: Target, start: np.ndarray, *, steps: int = 12, robust: bool = True
) -> Fit:
    """Aligns `target` with the grey `image` from the pose `start`; see the module."""
    pose = on_sampling_grid(start)
    jacobian, values = target.jacobian, target.values
    weight = np.ones_like(values)
    limit_px = 2 * target.width_px
    for step in range(steps):
        seen = target.values_at(image, pose)
        weighted = jacobian * weight[:, None]
        normal = weighted.T @ jacobian
        solution = np.linalg.solve(normal + target.ridge, weighted.T @ seen)
        residual = seen - jacobian @ solution
        size = np.abs(residual)
        # The median of an even number but for one place, in a third of np.median's time.
        noise = 1.4826 * np.partition(size, len(size) // 2)[len(size) // 2] + 1e-6
        if robust:
            weight = np.minimum(1.0, HUBER * noise / np.maximum(size, 1e-9))
            weight *= size < REJECT * noise
        # seen(x) = gain T(x + move) + offset: the pose has to follow by `move`, and the
        # gradient columns carry the gain.
        gain = solution[3] if abs(solution[3]) > 0.1 else np.copysign(0.1, solution[3] or 1.0)
        move = -solution[:3] / gain
        length = np.hypot(move[0], move[1])
        if length > limit_px:
            move[:2] *= limit_px / length
        move[2] = np.clip(move[2], -0.15, 0.15)
        sampled, pose = pose, compose(pose, move)
        following = on_sampling_grid(pose)
        if np.array_equal(following[:2], sampled[:2]) and abs(move[2]) < SETTLED_RAD:
            break
        if step < steps - 1:
            pose = following
    a = seen - np.average(seen, weights=weight)
    b = values - np.average(values, weights=weight)
    scale = np.sqrt((weight * a * a).sum() * (weight * b * b).sum()) + 1e-9
    return Fit(
        pose=pose,
        correlation=float((weight * a * b).sum() / scale),
        noise=float(noise),
        covered=float(np.mean(np.abs(residual) > COVERED * noise)),
        gain=float(solution[3]),
        weight=weight,
        residual=residual,
    )


def covariance_of(fit: Fit, target: Target) -> np.ndarray:
    """The `[3, 3]` covariance of a fit's pose, in image axes, that the image noise makes.

    The sandwich A^-1 B A^-1 of least squares with correlated noise: smoothing with a Gaussian of
    width s gives white noise the autocorrelation exp(-r^2 / 4 s^2), a Gaussian of width
    sqrt(2) s and sum 4 pi s^2. What remains of a picture is not white (a coder's noise is
    wider, what sampling does to a sharp texture is narrower): s is told by the residual.
    """
    width_px = _correlation_width_px(fit, target)
    weighted = target.jacobian * fit.weight[:, None]
    normal = weighted.T @ target.jacobian
    inverse = np.linalg.inv(normal + target.ridge)
    scores = np.zeros((*target.region.shape, 5))
    scores[target.region] = weighted
    spread = cv2.GaussianBlur(
        scores, (0, 0), np.sqrt(2) * width_px, borderType=cv2.BORDER_CONSTANT
    )[target.region]
    middle = weighted.T @ spread * (4 * np.pi * width_px**2)
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
