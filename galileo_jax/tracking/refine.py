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


@dataclass(frozen=True)
class Fit:
    """A pose, how well the template fits there, and what the fit is made of.

    Attributes:
      pose: `(x, y, angle)`.
      correlation: weighted correlation of patch and template, 1 is perfect.
      noise: robust standard deviation of the residual, grey levels of the smoothed patch.
      covered: share of the region whose residual is beyond four noise sigmas.
      covariance: `[3, 3]` of the pose in image axes, from the residual's noise alone.
    """

    pose: np.ndarray
    correlation: float
    noise: float
    covered: float
    covariance: np.ndarray


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
    move = np.zeros(3)
    limit_px = 2 * target.width_px
    for step in range(steps):
        pose = on_sampling_grid(pose)
        seen = target.values_at(image, pose)
        weighted = jacobian * weight[:, None]
        normal = weighted.T @ jacobian
        normal[np.diag_indices(5)] *= 1 + 1e-9
        solution = np.linalg.solve(normal + 1e-9 * np.eye(5), weighted.T @ seen)
        residual = seen - jacobian @ solution
        noise = 1.4826 * np.median(np.abs(residual)) + 1e-6
        if robust:
            size = np.maximum(np.abs(residual), 1e-9)
            weight = np.minimum(1.0, HUBER * noise / size) * (size < REJECT * noise)
        # seen(x) = gain T(x + move) + offset: the pose has to follow by `move`, and the
        # gradient columns carry the gain.
        gain = solution[3] if abs(solution[3]) > 0.1 else np.copysign(0.1, solution[3] or 1.0)
        move = -solution[:3] / gain
        length = np.hypot(move[0], move[1])
        if length > limit_px:
            move[:2] *= limit_px / length
        move[2] = np.clip(move[2], -0.15, 0.15)
        pose = compose(pose, move)
        if step and length < 0.004 and abs(move[2]) < 2e-4:
            break
    return _fit(pose, solution, residual, noise, seen, weight, target)


def _fit(pose, solution, residual, noise, seen, weight, target) -> Fit:
    a = seen - np.average(seen, weights=weight)
    b = target.values - np.average(target.values, weights=weight)
    scale = np.sqrt((weight * a * a).sum() * (weight * b * b).sum()) + 1e-9
    return Fit(
        pose=pose,
        correlation=float((weight * a * b).sum() / scale),
        noise=float(noise),
        covered=float(np.mean(np.abs(residual) > 4 * noise)),
        covariance=_covariance(pose, solution[3], noise, weight, target),
    )


def _covariance(pose, gain, noise, weight, target) -> np.ndarray:
    """The sandwich A^-1 B A^-1 of least squares whose noise is correlated by the smoothing.

    Smoothing white noise with a Gaussian of width s gives the autocorrelation
    exp(-r^2 / 4 s^2): a Gaussian of width sqrt(2) s and sum 4 pi s^2.
    """
    weighted = target.jacobian * weight[:, None]
    inverse = np.linalg.inv(weighted.T @ target.jacobian + 1e-9 * np.eye(5))
    scores = np.zeros((*target.region.shape, 5))
    scores[target.region] = weighted
    spread = cv2.GaussianBlur(
        scores, (0, 0), np.sqrt(2) * target.width_px, borderType=cv2.BORDER_CONSTANT
    )[target.region]
    middle = weighted.T @ spread * (4 * np.pi * target.width_px**2)
    own = noise**2 * (inverse @ middle @ inverse)[:3, :3] / max(gain**2, 1e-6)
    turn = np.eye(3)
    turn[:2, :2] = rotation(pose[2])
    return turn @ own @ turn.T
